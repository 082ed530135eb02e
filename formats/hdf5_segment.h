// What the HDF5 files of all stores have in common (lattice_segment.h, border_segment.h).
//
// A file is built in memory, so that only our own code meets a full disk, and ends with a seal
// (formats/file_seal.h), which HDF5 ignores. Root attributes `format_version` (int32) and `scheme`
// ("geodetic" or "mercator"); one chunked dataset, whose chunks are outside the seal and carry
// hashes of their own; small datasets of numbers beside it. HDF5's ids are 64-bit integers here, so
// that its headers stay out of ours. Different objects may be used from different threads at once
// where HDF5 was built thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "formats/file_seal.h"
#include "formats/hdf5_handle.h"
#include "formats/result.h"
#include "scheduler/tiling_scheme.h"

namespace qmpipe {

const char* segment_scheme_name(const TilingScheme& scheme);

struct LocatedChunk {
  std::uint64_t row = 0;  // the chunk's first, along the first dimension
  ByteRange range;
};

// Throws IoError, naming the file, when HDF5 fails (it never should: there is no file yet).
class Hdf5SegmentWriter {
 public:
  struct Finished {
    std::vector<std::uint8_t> bytes;  // the whole file, sealed
    std::vector<LocatedChunk> chunks;
  };

  // No other thread may write under the same path.
  Hdf5SegmentWriter(std::filesystem::path path, std::int32_t format_version,
                    const TilingScheme& scheme);

  // `type` and `fill` (null: zeros) are HDF5's; `fill_type` is the type of `fill` in memory. Bytes
  // go through the shuffle filter and zstd (registered filter 32015). REQUIRES: called once, before
  // the functions below.
  void create_chunked(const char* name, std::int64_t type, const std::vector<std::uint64_t>& shape,
                      const std::vector<std::uint64_t>& chunk_shape, std::int64_t fill_type,
                      const void* fill);
  // `chunk` as the filters would have made it.
  void write_chunk(std::uint64_t row, std::span<const std::uint8_t> chunk);
  // A dataset (n) or, with several columns, (n, columns). T: std::int32_t, std::uint8_t or
  // std::uint64_t.
  template <class T>
  void write_values(const char* name, std::size_t columns, const std::vector<T>& values);
  Finished finish();

 private:
  Hdf5Handle made(std::int64_t id, Hdf5Handle::Close close) const;
  void check(int status) const;
  [[noreturn]] void fail() const;
  Hdf5Handle create_file() const;
  void write_attributes(std::int32_t format_version, const TilingScheme& scheme) const;
  std::vector<LocatedChunk> locate_chunks() const;
  std::vector<std::uint8_t> image() const;

  const std::filesystem::path path_;
  const Hdf5Handle file_;
  std::optional<Hdf5Handle> chunked_;
  std::size_t dimensions_ = 0;
};

struct ChunkedDataset {
  std::vector<std::uint64_t> shape;
  std::vector<std::uint64_t> chunk_shape;
  std::uint64_t element_bytes = 0;
  std::vector<LocatedChunk> chunks;
};

// Every Error names the file and the remedy.
class Hdf5SegmentReader {
 public:
  // Refuses a file whose seal is broken, that HDF5 cannot open, or that is of another version or
  // scheme.
  static Result<Hdf5SegmentReader> open(const std::filesystem::path& path,
                                        std::int32_t format_version, const TilingScheme& scheme);

  Error refused(const std::string& cause) const;
  Error refused_shape(const std::string& name) const;

  // All values of a dataset of shape (n) or, with several columns, (n, columns); 1 <= n <=
  // limit_rows. T as in Hdf5SegmentWriter.
  template <class T>
  Result<std::vector<T>> values(const char* name, std::size_t columns,
                                std::size_t limit_rows) const;
  // Refuses more chunks than limit_chunks, larger ones than limit_bytes, and such as not all
  // filters were applied to.
  Result<ChunkedDataset> chunked(const char* name, std::size_t limit_chunks,
                                 std::size_t limit_bytes) const;

 private:
  Hdf5SegmentReader(std::filesystem::path path, Hdf5Handle file)
      : path_(std::move(path)), file_(std::move(file)) {}
  Error refused_by_hdf5(const std::string& what) const;
  Result<std::int32_t> version_attribute() const;
  Result<std::string> scheme_attribute() const;
  std::optional<Error> check_header(std::int32_t format_version, const TilingScheme& scheme) const;
  std::optional<Error> read_shapes(const Hdf5Handle& data, const std::string& what,
                                   ChunkedDataset& dataset) const;

  std::filesystem::path path_;
  Hdf5Handle file_;
};

}  // namespace qmpipe
