// The header and the directories of a PMTiles archive as bytes, version 3
// (https://github.com/protomaps/PMTiles/blob/main/spec/v3/spec.md).
//
// Guarantees: what is written here is read back equal. Reading takes any bytes: it never throws for
// them, and refuses sections outside the file, numbers that overflow, ids that do not ascend or
// overlap, tiles outside the tile section, more entries than the bytes can hold, leaves nested
// deeper than kDeepestLeaf, and more tiles than the file has bytes for (some 17 million are always
// allowed); memory stays within 80 bytes for each of these and some 100 MB.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "formats/bytes/result.h"
#include "scheduler/tiling_scheme.h"

namespace qmpipe {

inline constexpr std::uint64_t kPmtilesHeaderBytes = 127;
// Header and root directory lie in front of it.
inline constexpr std::uint64_t kPmtilesRootEnd = 16384;
// Keys of the metadata, and values of `tiling`.
inline constexpr const char* kLayerJsonKey = "layer.json";
inline constexpr const char* kTilingGeodetic = "geodetic-z+1";
inline constexpr const char* kTilingMercator = "mercator";
// Directories below the root at most, one in the other; the usual readers go no deeper either.
inline constexpr std::int32_t kDeepestLeaf = 3;

enum class PmtilesCompression : std::uint8_t {
  kUnknown = 0,
  kNone = 1,
  kGzip = 2,
  kBrotli = 3,
  kZstd = 4
};

// A section of the file.
struct PmtilesSection {
  std::uint64_t offset = 0;
  std::uint64_t bytes = 0;
  friend bool operator==(const PmtilesSection&, const PmtilesSection&) = default;
};

struct PmtilesHeader {
  PmtilesSection root;
  PmtilesSection metadata;
  PmtilesSection leaves;
  PmtilesSection tiles;
  // 0 where unknown.
  std::uint64_t addressed_tiles = 0;
  std::uint64_t entries = 0;
  std::uint64_t contents = 0;
  bool is_clustered = false;
  PmtilesCompression directory_compression = PmtilesCompression::kGzip;  // the metadata's too
  PmtilesCompression tile_compression = PmtilesCompression::kNone;
  std::uint8_t tile_type = 0;
  std::uint8_t min_zoom = 0;
  std::uint8_t max_zoom = 0;
  // Kept to 1e-7 degrees, within +-180 and +-90.
  RectangleDeg bounds_deg;
  std::uint8_t centre_zoom = 0;
  double centre_longitude_deg = 0;
  double centre_latitude_deg = 0;
  friend bool operator==(const PmtilesHeader&, const PmtilesHeader&) = default;
};

// `run_length` tiles from `id` on, all of them these bytes of the tile section. A run of 0: a leaf
// directory, these bytes of the leaf section, for the tiles from `id` on.
struct PmtilesEntry {
  std::uint64_t id = 0;
  std::uint64_t offset = 0;
  std::uint32_t bytes = 0;
  std::uint32_t run_length = 0;
  friend bool operator==(const PmtilesEntry&, const PmtilesEntry&) = default;
};

std::vector<std::uint8_t> write_pmtiles_header(const PmtilesHeader& header);
// `bytes`: the file's first ones; `file_bytes`: its size.
Result<PmtilesHeader> read_pmtiles_header(std::span<const std::uint8_t> bytes,
                                          std::uint64_t file_bytes);

// One directory, uncompressed. REQUIRES: at least one entry, ids ascending, no entry of 0 bytes.
std::vector<std::uint8_t> write_pmtiles_directory(std::span<const PmtilesEntry> entries);
Result<std::vector<PmtilesEntry>> read_pmtiles_directory(std::span<const std::uint8_t> bytes);

// All directories, gzipped: the root fits in front of kPmtilesRootEnd with the header. `leaves` is
// empty when the root holds every tile itself. REQUIRES: as write_pmtiles_directory().
struct PmtilesDirectories {
  std::vector<std::uint8_t> root;
  std::vector<std::uint8_t> leaves;
};
PmtilesDirectories write_pmtiles_directories(std::span<const PmtilesEntry> entries);

// An archive's header and its tiles: entries with a run, by id, leaves resolved.
struct PmtilesIndex {
  PmtilesHeader header;
  std::vector<PmtilesEntry> entries;
};
// `read` returns that many bytes of the file from that offset on.
using ReadFileBytes =
    std::function<Result<std::vector<std::uint8_t>>(std::uint64_t offset, std::uint64_t bytes)>;
Result<PmtilesIndex> read_pmtiles_index(const ReadFileBytes& read, std::uint64_t file_bytes);

// A section's plain bytes. Refuses compressions other than gzip, and what would exceed limit_bytes.
Result<std::vector<std::uint8_t>> plain_pmtiles_section(std::vector<std::uint8_t> stored,
                                                        PmtilesCompression compression,
                                                        std::uint64_t limit_bytes);

}  // namespace qmpipe
