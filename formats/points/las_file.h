// LAS 1.0 to 1.4 (ASPRS, LAS Specification 1.4 R15): the header, where the file says which CRS it is in,
// and its points one by one.
//
// Guarantees: any bytes give a header or an Error, nothing is read outside the source, and memory
// does not grow with the number of points. Waveforms, colours and times are skipped. LAZ is told from
// LAS and refused.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "formats/bytes/result.h"

namespace qmpipe {

// What every LAS file begins with.
inline constexpr std::string_view kLasSignature = "LASF";

// Bytes that are read in pieces: of a file, or of memory in tests.
struct ByteSource {
  std::uint64_t size_bytes = 0;
  // REQUIRES: offset + bytes <= size_bytes. All of them, or why not.
  std::function<Result<std::vector<std::uint8_t>>(std::uint64_t offset, std::size_t bytes)> read;
};

// What the records of the header say; all empty when it says nothing.
struct LasCrs {
  std::string wkt;
  // The GeoTIFF tags 34735, 34736 and 34737 as they are.
  std::vector<std::uint16_t> geo_keys;
  std::vector<double> geo_doubles;
  std::string geo_text;
};

struct LasHeader {
  int minor_version = 0;
  int point_format = 0;  // 0..10
  std::uint32_t record_bytes = 0;
  std::uint64_t points_offset = 0;
  std::uint64_t point_count = 0;
  // coordinate = offset + scale * integer; finite, scales above 0.
  std::array<double, 3> scale = {1, 1, 1};
  std::array<double, 3> offset{};
  LasCrs crs;
};

struct LasPoint {
  std::array<std::int32_t, 3> at{};
  std::uint8_t classification = 0;
  bool is_withheld = false;
  // Classes 7 (low noise) and, in formats 6 to 10, 18 (high noise).
  bool is_noise = false;
};

// Refuses a damaged or compressed file, and one that ends before its last point.
Result<LasHeader> read_las_header(const ByteSource& source);

// In the file's order. REQUIRES: the header read from this source.
std::optional<Error> for_each_las_point(const ByteSource& source, const LasHeader& header,
                                        const std::function<void(const LasPoint&)>& visit);

}  // namespace qmpipe
