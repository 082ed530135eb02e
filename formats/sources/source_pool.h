// Rasters that are opened when they are first read, and closed again when others need their place: so
// that any number of them can be read with few files open and little memory.
//
// Guarantees: what a source says and reads does not depend on when it was opened. A pool is used by
// one thread at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "formats/sources/raster_source.h"

namespace qmpipe {

class SourcePool {
 public:
  // `infos`: what RasterSource::open() told of the rasters with these options; a raster's number is its
  // place among them. REQUIRES: most_open >= 1.
  SourcePool(std::shared_ptr<const std::vector<RasterInfo>> infos, OpenOptions options,
             std::size_t most_open);

  std::size_t size() const { return infos_->size(); }
  const RasterInfo& info(std::size_t number) const { return (*infos_)[number]; }
  // Stays open until so many others as may be open were asked for. Throws IoError as
  // RasterSource::open() does, and when the raster is not the one that the info tells of.
  const RasterSource& source(std::size_t number);
  // The grid that it lies on, alone or with others. Stays until so many other grids as rasters may be
  // open were asked for.
  const GridInfo& grid_info(std::size_t number) const;
  const RasterGrid& grid(std::size_t number);

 private:
  struct Opened {
    std::size_t number = 0;
    std::int64_t last_asked = 0;
    std::unique_ptr<RasterSource> source;
  };
  struct Placed {
    const GridInfo* info = nullptr;
    std::int64_t last_asked = 0;
    std::unique_ptr<RasterGrid> grid;
  };
  std::unique_ptr<RasterSource> open(std::size_t number) const;

  std::shared_ptr<const std::vector<RasterInfo>> infos_;
  OpenOptions options_;
  std::size_t most_open_;
  std::vector<Opened> opened_;
  std::vector<Placed> placed_;
  std::int64_t asked_ = 0;
};

// How many rasters each of the threads may have open, such that the process stays well below the
// files that it may have open (ulimit -n).
std::size_t sources_open_at_once(std::int32_t threads);

// What an open one takes besides RasterInfo::handle_bytes: GDAL's dataset and PROJ's operation.
inline constexpr std::int64_t kOpenSourceBytes = 320LL << 10U;

}  // namespace qmpipe
