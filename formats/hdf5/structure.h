// The structure of an HDF5 file as Hdf5SegmentWriter has it made, read without the HDF5 library:
// that one trusts what it reads, and follows links, external storage and virtual datasets into
// other files.
//
// Guarantees: whatever the bytes are, nothing is read but this file, no read goes past its end, and
// work and memory are bounded by its size; it ends with what is there or an Error. Knows what HDF5
// 1.10 to 1.14 write unless told otherwise (superblock 0, object headers of version 1, groups as
// symbol tables, chunks in B-trees of version 1) and refuses everything else, so a link can only
// lead to an object of the file. Source: HDF5 File Format Specification, version 3.0.
// const use is safe from several threads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "formats/bytes/result.h"
#include "formats/bytes/seal.h"

namespace qmpipe {

// A chunk of a dataset, and where its bytes are.
struct LocatedChunk {
  std::uint64_t row = 0;  // the chunk's first, along the first dimension
  ByteRange range;
};

// As the datatype message has it (sections IV.A.2.d and VII): class, bits, size, properties.
using Hdf5Type = std::vector<std::uint8_t>;

struct Hdf5Attribute {
  Hdf5Type type;
  bool is_scalar = false;
  std::vector<std::uint8_t> value;
};

struct Hdf5Dataset {
  Hdf5Type type;
  std::vector<std::uint64_t> shape;
  // Not chunked: all values, at once and without filters.
  ByteRange values;
  bool is_chunked = false;
  std::vector<std::uint64_t> chunk_shape;
  std::uint64_t element_bytes = 0;
  std::uint64_t chunk_index = 0;  // address of the B-tree
  std::vector<std::uint16_t> filters;
};

class Hdf5Structure {
 public:
  // The root group: its attributes and the names in it.
  static Result<Hdf5Structure> read(const std::filesystem::path& path);

  // Null when there is none.
  const Hdf5Attribute* attribute(const std::string& name) const;
  Result<Hdf5Dataset> dataset(const std::string& name) const;
  // In the order of their first rows, which differ; their bytes do not overlap. Refuses more than
  // `limit`, and such as not all filters were applied to. REQUIRES: a chunked dataset of this file.
  Result<std::vector<LocatedChunk>> chunks(const Hdf5Dataset& dataset, std::size_t limit) const;
  // REQUIRES: a dataset of this file that is not chunked.
  Result<std::vector<std::uint8_t>> values_of(const Hdf5Dataset& dataset) const;

 private:
  class Parser;

  std::filesystem::path path_;
  std::uint64_t end_ = 0;  // of what is HDF5's
  std::map<std::string, Hdf5Attribute> attributes_;
  std::map<std::string, std::uint64_t> objects_;  // address of each one's header
};

}  // namespace qmpipe
