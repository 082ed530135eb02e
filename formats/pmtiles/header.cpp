#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "formats/bytes/little_endian.h"
#include "formats/pmtiles/directory.h"

namespace qmpipe {
namespace {

constexpr std::array<std::uint8_t, 8> kPmtilesMagic = {'P', 'M', 'T', 'i', 'l', 'e', 's', 3};
constexpr double kStepsPerDegree = 1e7;

// Where the fields lie.
constexpr std::size_t kSections = 8;
constexpr std::size_t kCounts = 72;
constexpr std::size_t kFlags = 96;
constexpr std::size_t kBounds = 102;
constexpr std::size_t kCentre = 118;

class HeaderWriter {
 public:
  HeaderWriter() { std::copy(kPmtilesMagic.begin(), kPmtilesMagic.end(), bytes_.begin()); }
  void put_section(std::size_t index, const PmtilesSection& section) {
    put(kSections + 16 * index, section.offset);
    put(kSections + 16 * index + 8, section.bytes);
  }
  template <class Number>
  void put(std::size_t at, Number value) {
    store_little_endian(bytes_.data() + at, value);
  }
  void put_degrees(std::size_t at, double degrees, double limit_deg) {
    // Other programs' layer.json may hold any bounds.
    const double kept = std::isfinite(degrees) ? std::clamp(degrees, -limit_deg, limit_deg) : 0;
    put(at, static_cast<std::int32_t>(std::lround(kept * kStepsPerDegree)));
  }
  std::vector<std::uint8_t> take() { return std::move(bytes_); }

 private:
  std::vector<std::uint8_t> bytes_ = std::vector<std::uint8_t>(kPmtilesHeaderBytes);
};

PmtilesSection section_at(std::span<const std::uint8_t> bytes, std::size_t index) {
  const std::uint8_t* const from = bytes.data() + kSections + 16 * index;
  return {.offset = load_little_endian<std::uint64_t>(from),
          .bytes = load_little_endian<std::uint64_t>(from + 8)};
}

double degrees_at(std::span<const std::uint8_t> bytes, std::size_t at) {
  return load_little_endian<std::int32_t>(bytes.data() + at) / kStepsPerDegree;
}

Result<PmtilesCompression> compression_of(std::uint8_t code, const char* what) {
  if (code <= static_cast<std::uint8_t>(PmtilesCompression::kGzip)) {
    return static_cast<PmtilesCompression>(code);
  }
  const char* const name = code == 3 ? "brotli" : code == 4 ? "zstd" : "an unknown method";
  return Error{fmt::format("its {} are compressed by {}; only gzip is read", what, name)};
}

Result<PmtilesHeader> checked_sections(const PmtilesHeader& header, std::uint64_t file_bytes) {
  struct Named {
    const char* name = nullptr;
    PmtilesSection section;
  };
  for (const Named& named :
       {Named{"root directory", header.root}, Named{"metadata", header.metadata},
        Named{"leaf directories", header.leaves}, Named{"tiles", header.tiles}}) {
    const PmtilesSection& section = named.section;
    // Where a section is empty its offset means nothing.
    if (section.bytes == 0) continue;
    if (section.offset < kPmtilesHeaderBytes || section.offset > file_bytes ||
        section.bytes > file_bytes - section.offset) {
      return Error{fmt::format("its {} should be {} bytes at byte {}, but the file has {} bytes",
                               named.name, section.bytes, section.offset, file_bytes)};
    }
  }
  if (header.root.bytes == 0) return Error{"it has no root directory"};
  return header;
}

}  // namespace

std::vector<std::uint8_t> write_pmtiles_header(const PmtilesHeader& header) {
  HeaderWriter writer;
  writer.put_section(0, header.root);
  writer.put_section(1, header.metadata);
  writer.put_section(2, header.leaves);
  writer.put_section(3, header.tiles);
  writer.put(kCounts, header.addressed_tiles);
  writer.put(kCounts + 8, header.entries);
  writer.put(kCounts + 16, header.contents);
  writer.put(kFlags, static_cast<std::uint8_t>(header.is_clustered ? 1 : 0));
  writer.put(kFlags + 1, static_cast<std::uint8_t>(header.directory_compression));
  writer.put(kFlags + 2, static_cast<std::uint8_t>(header.tile_compression));
  writer.put(kFlags + 3, header.tile_type);
  writer.put(kFlags + 4, header.min_zoom);
  writer.put(kFlags + 5, header.max_zoom);
  writer.put_degrees(kBounds, header.bounds_deg.west_deg, 180);
  writer.put_degrees(kBounds + 4, header.bounds_deg.south_deg, 90);
  writer.put_degrees(kBounds + 8, header.bounds_deg.east_deg, 180);
  writer.put_degrees(kBounds + 12, header.bounds_deg.north_deg, 90);
  writer.put(kCentre, header.centre_zoom);
  writer.put_degrees(kCentre + 1, header.centre_longitude_deg, 180);
  writer.put_degrees(kCentre + 5, header.centre_latitude_deg, 90);
  return writer.take();
}

Result<PmtilesHeader> read_pmtiles_header(std::span<const std::uint8_t> bytes,
                                          std::uint64_t file_bytes) {
  if (bytes.size() < kPmtilesMagic.size() ||
      std::memcmp(bytes.data(), kPmtilesMagic.data(), 7) != 0) {
    return Error{"it does not begin as a PMTiles archive does"};
  }
  if (bytes[7] != kPmtilesMagic[7]) {
    return Error{fmt::format("it is of PMTiles version {}; only version 3 is read", bytes[7])};
  }
  if (bytes.size() < kPmtilesHeaderBytes) return Error{"it ends within the header"};
  PmtilesHeader header;
  header.root = section_at(bytes, 0);
  header.metadata = section_at(bytes, 1);
  header.leaves = section_at(bytes, 2);
  header.tiles = section_at(bytes, 3);
  header.addressed_tiles = load_little_endian<std::uint64_t>(bytes.data() + kCounts);
  header.entries = load_little_endian<std::uint64_t>(bytes.data() + kCounts + 8);
  header.contents = load_little_endian<std::uint64_t>(bytes.data() + kCounts + 16);
  header.is_clustered = bytes[kFlags] == 1;
  const auto of_directories = compression_of(bytes[kFlags + 1], "directories");
  if (!of_directories) return of_directories.error();
  header.directory_compression = *of_directories;
  const auto of_tiles = compression_of(bytes[kFlags + 2], "tiles");
  if (!of_tiles) return of_tiles.error();
  header.tile_compression = *of_tiles;
  header.tile_type = bytes[kFlags + 3];
  header.min_zoom = bytes[kFlags + 4];
  header.max_zoom = bytes[kFlags + 5];
  header.bounds_deg = {.west_deg = degrees_at(bytes, kBounds),
                       .south_deg = degrees_at(bytes, kBounds + 4),
                       .east_deg = degrees_at(bytes, kBounds + 8),
                       .north_deg = degrees_at(bytes, kBounds + 12)};
  header.centre_zoom = bytes[kCentre];
  header.centre_longitude_deg = degrees_at(bytes, kCentre + 1);
  header.centre_latitude_deg = degrees_at(bytes, kCentre + 5);
  return checked_sections(header, file_bytes);
}

}  // namespace qmpipe
