// The raw values of a band, straight from GDAL or through the cache of decoded blocks. For formats/
// only.
//
// Guarantees: both ways give the same values, bit for bit. A reader is used by one thread at a time.
// What the cache holds as one block are one or more blocks of the file, so that small ones are not
// looked up one by one; GDAL's own cache is gone round where a block of ours is one of the file's or
// a stack of strips.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "formats/raster/block_cache.h"
#include "formats/raster/info.h"

class GDALRasterBand;

namespace qmpipe {

// Fills in what `info` says about blocks, from a band whose driver and size it has already.
void describe_blocks(GDALRasterBand& band, bool has_mask, RasterInfo& info);

class RasterReader;

// Is shown the values of blocks that come into the cache, in pieces. May throw what ends the reading.
class BlockWatcher {
 public:
  virtual ~BlockWatcher() = default;
  virtual bool wants(std::int64_t block) = 0;
  // Masked ones are NaN. The values may be changed: nobody else has them.
  virtual void see(std::span<double> values) = 0;
  virtual void done(std::int64_t block, const RasterReader& reader) = 0;
};

class RasterReader {
 public:
  // REQUIRES: describe_blocks() was done on `info`; band, info and watcher outlive the reader.
  // `cache` and `watcher` may be null; without a cache there is nothing to watch.
  RasterReader(GDALRasterBand& band, bool has_mask, const RasterInfo& info,
               std::shared_ptr<SourceBlockCache> cache, std::uint32_t source_number,
               BlockWatcher* watcher);

  // Row by row from the top; `mask` is 0 where the value is void, and empty where the band has no
  // mask. REQUIRES: the window lies inside the raster; sizes fit. Throws IoError.
  void read(const PixelWindow& window, std::span<double> values,
            std::span<std::uint8_t> mask) const;
  // The same, past the cache.
  void read_past_cache(const PixelWindow& window, std::span<double> values,
                       std::span<std::uint8_t> mask) const;

 private:
  struct Kind {
    int type = 0;  // GDAL's number
    std::int64_t value_bytes = 0;
    bool goes_round_gdal_cache = false;
    bool mask_is_shaped_alike = false;
  };

  void read_block(std::int64_t column, std::int64_t row, const PixelWindow& window,
                  std::span<double> values, std::span<std::uint8_t> mask) const;
  void decode(std::int64_t column, std::int64_t row, std::span<std::uint8_t> bytes) const;
  void show(std::int64_t block, const PixelWindow& covered,
            std::span<const std::uint8_t> bytes) const;
  void copy_values(const std::uint8_t* from, double* to, std::int64_t count) const;
  void decode_file_blocks(GDALRasterBand& band, const PixelWindow& covered,
                          std::span<std::uint8_t> bytes) const;
  void raster_io(GDALRasterBand& band, const PixelWindow& window, int type, void* into,
                 std::int64_t row_bytes) const;
  PixelWindow covered_by(std::int64_t column, std::int64_t row) const;

  GDALRasterBand& band_;
  GDALRasterBand* mask_ = nullptr;  // null where there is none
  const RasterInfo& info_;
  std::shared_ptr<SourceBlockCache> cache_;
  std::uint32_t source_number_;
  BlockWatcher* watcher_;
  Kind kind_;
};

}  // namespace qmpipe
