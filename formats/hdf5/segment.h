// What all HDF5 files of ours have in common (formats/run_store/lattice_segment.h and
// border_segment.h there, formats/detail_model/file.h).
//
// A file is built in memory, so that only our own code meets a full disk, and ends with a seal
// (formats/bytes/seal.h), which HDF5 ignores. Root attributes `format_version` (int32) and a text
// that tells what it is: of a store's file `scheme` ("geodetic" or "mercator"); chunked datasets,
// and small ones of numbers beside them. A store's file has one chunked dataset, whose chunks are
// outside the seal and carry hashes of their own. HDF5's ids are 64-bit integers here, so that
// its headers stay out of ours. The HDF5 library only writes: a seal is no proof against malice, and
// the library trusts what it reads. Different writers may be used from different threads at once
// where HDF5 was built thread-safe, readers anywhere.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "formats/bytes/result.h"
#include "formats/bytes/seal.h"
#include "formats/hdf5/handle.h"
#include "formats/hdf5/structure.h"
#include "scheduler/tiling_scheme.h"

namespace qmpipe {

// As it is registered with the HDF Group.
inline constexpr std::uint16_t kZstdFilter = 32015;

const char* segment_scheme_name(const TilingScheme& scheme);

// What a file says it is, and the words for one that says something else: "its `called` is
// mercator, `wanted_by` is geodetic; `remedy`".
struct SegmentIdentity {
  std::int32_t format_version = 0;
  const char* attribute = "";
  std::string value;  // 1 to 64 bytes
  const char* called = "";
  const char* wanted_by = "";
  const char* remedy = "";
};
SegmentIdentity store_identity(std::int32_t format_version, const TilingScheme& scheme);

// Throws IoError, naming the file, when HDF5 fails (it never should: there is no file yet).
class Hdf5SegmentWriter {
 public:
  struct Finished {
    std::vector<std::uint8_t> bytes;  // the whole file, sealed
    std::vector<LocatedChunk> chunks;
  };

  // No other thread may write under the same path.
  Hdf5SegmentWriter(std::filesystem::path path, const SegmentIdentity& identity);

  // A root attribute. REQUIRES: text is not empty.
  void write_text(const char* name, const std::string& text) const;

  // `type` and `fill` (null: zeros) are HDF5's; `fill_type` is the type of `fill` in memory. Bytes
  // go through the shuffle filter and zstd (registered filter 32015).
  void create_chunked(const char* name, std::int64_t type, const std::vector<std::uint64_t>& shape,
                      const std::vector<std::uint64_t>& chunk_shape, std::int64_t fill_type,
                      const void* fill);
  // To the last dataset made; `chunk` as the filters would have made it.
  void write_chunk(std::uint64_t row, std::span<const std::uint8_t> chunk);
  // A dataset (n) or, with several columns, (n, columns). T: std::int32_t, std::uint8_t,
  // std::uint64_t or double.
  template <class T>
  void write_values(const char* name, std::size_t columns, const std::vector<T>& values);
  // The chunks are outside the seal. REQUIRES: one chunked dataset.
  Finished finish();
  // The whole file, its chunks under the seal as well; with zeros, which HDF5 ignores, to at least so
  // many bytes.
  std::vector<std::uint8_t> finish_whole(std::size_t least_bytes);

 private:
  Hdf5Handle made(std::int64_t id, Hdf5Handle::Close close) const;
  void check(int status) const;
  [[noreturn]] void fail() const;
  Hdf5Handle create_file() const;
  void write_version(std::int32_t format_version) const;
  std::vector<LocatedChunk> locate_chunks() const;
  std::vector<std::uint8_t> image() const;

  const std::filesystem::path path_;
  const Hdf5Handle file_;
  std::vector<Hdf5Handle> chunked_;
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
  // Refuses a file whose seal is broken, that is no HDF5 file of ours, or says it is something else.
  static Result<Hdf5SegmentReader> open(const std::filesystem::path& path,
                                        const SegmentIdentity& identity);

  Error refused(const std::string& cause) const;
  Error refused_shape(const std::string& name) const;

  // A root attribute; empty when there is none. Refuses more than limit_bytes.
  Result<std::string> text(const char* name, std::size_t limit_bytes) const;
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
  Hdf5SegmentReader(std::filesystem::path path, Hdf5Structure structure, const char* remedy)
      : path_(std::move(path)), structure_(std::move(structure)), remedy_(remedy) {}
  Error refused_unread(const std::string& what, const Error& cause) const;
  Result<std::int32_t> version_attribute() const;
  std::optional<Error> check_header(const SegmentIdentity& identity) const;

  std::filesystem::path path_;
  Hdf5Structure structure_;
  const char* remedy_;
};

}  // namespace qmpipe
