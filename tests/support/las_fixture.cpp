#include "tests/support/las_fixture.h"

#include <cstring>
#include <stdexcept>

#include "formats/bytes/little_endian.h"

namespace qmpipe::testing {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::uint8_t kFiller = 0xA5;

template <class T>
void put(Bytes& bytes, std::size_t at, T value) {
  if (bytes.size() < at + sizeof(T)) bytes.resize(at + sizeof(T), kFiller);
  store_little_endian(bytes.data() + at, value);
}

void add_record_header(Bytes& bytes, std::uint16_t id) {
  std::array<char, 16> user{};
  std::strcpy(user.data(), "LASF_Projection");
  put<std::uint16_t>(bytes, bytes.size(), 0);
  bytes.insert(bytes.end(), user.begin(), user.end());
  put(bytes, bytes.size(), id);
}

void add_record(Bytes& bytes, std::uint16_t id, const Bytes& payload) {
  add_record_header(bytes, id);
  put(bytes, bytes.size(), static_cast<std::uint16_t>(payload.size()));
  bytes.resize(bytes.size() + 32);
  bytes.insert(bytes.end(), payload.begin(), payload.end());
}

void add_extended_record(Bytes& bytes, std::uint16_t id, const Bytes& payload) {
  add_record_header(bytes, id);
  put(bytes, bytes.size(), static_cast<std::uint64_t>(payload.size()));
  bytes.resize(bytes.size() + 32);
  bytes.insert(bytes.end(), payload.begin(), payload.end());
}

std::size_t record_bytes(const LasFixture& fixture) {
  constexpr std::array<std::size_t, 11> kBytes = {20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};
  return kBytes.at(static_cast<std::size_t>(fixture.format)) + fixture.extra_bytes;
}

std::size_t header_bytes(int minor_version) {
  if (minor_version == 4) return 375;
  return minor_version == 3 ? 235 : 227;
}

void add_point(Bytes& bytes, const LasFixture& fixture, const LasFixturePoint& point) {
  const std::size_t begin = bytes.size();
  bytes.resize(begin + record_bytes(fixture), kFiller);
  for (std::size_t axis = 0; axis < 3; ++axis) put(bytes, begin + 4 * axis, point.at[axis]);
  if (fixture.format >= 6) {
    bytes[begin + 15] = point.is_withheld ? 0xF4 : 0xF0;  // scanner channel and edge all ones
    bytes[begin + 16] = point.classification;
  } else {
    bytes[begin + 15] =
        static_cast<std::uint8_t>(point.classification | (point.is_withheld ? 0x80 : 0));
  }
}

}  // namespace

Bytes las_bytes(const LasFixture& fixture) {
  Bytes bytes(header_bytes(fixture.minor_version), kFiller);
  std::memcpy(bytes.data(), "LASF", 4);
  bytes[24] = 1;
  bytes[25] = static_cast<std::uint8_t>(fixture.minor_version);
  put(bytes, 94, static_cast<std::uint16_t>(bytes.size()));
  bytes[104] = static_cast<std::uint8_t>(fixture.format);
  put(bytes, 105, static_cast<std::uint16_t>(record_bytes(fixture)));
  const bool is_new = fixture.format >= 6;
  put(bytes, 107, is_new ? 0U : static_cast<std::uint32_t>(fixture.points.size()));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    put(bytes, 131 + 8 * axis, fixture.scale[axis]);
    put(bytes, 155 + 8 * axis, fixture.offset[axis]);
  }
  std::uint32_t records = 0;
  const Bytes wkt(fixture.wkt.c_str(), fixture.wkt.c_str() + fixture.wkt.size() + 1);
  if (!fixture.wkt.empty() && !fixture.wkt_at_end) {
    add_record(bytes, 2112, wkt);
    ++records;
  }
  if (!fixture.geo_keys.empty()) {
    Bytes keys;
    for (const std::uint16_t key : fixture.geo_keys) put(keys, keys.size(), key);
    add_record(bytes, 34735, keys);
    ++records;
  }
  if (!fixture.geo_doubles.empty()) {
    Bytes doubles;
    for (const double value : fixture.geo_doubles) put(doubles, doubles.size(), value);
    add_record(bytes, 34736, doubles);
    ++records;
  }
  put(bytes, 96, static_cast<std::uint32_t>(bytes.size()));
  put(bytes, 100, records);
  for (const LasFixturePoint& point : fixture.points) add_point(bytes, fixture, point);
  if (fixture.minor_version == 4) {
    put(bytes, 235, static_cast<std::uint64_t>(bytes.size()));
    put(bytes, 243, fixture.wkt_at_end ? 1U : 0U);
    put(bytes, 247, static_cast<std::uint64_t>(fixture.points.size()));
    if (fixture.wkt_at_end) add_extended_record(bytes, 2112, wkt);
  }
  return bytes;
}

ByteSource source_of(const Bytes& bytes) {
  return {.size_bytes = bytes.size(),
          .read = [&bytes](std::uint64_t offset, std::size_t count) -> Result<Bytes> {
            if (offset > bytes.size() || count > bytes.size() - offset) {
              throw std::out_of_range("read outside the source");
            }
            const auto from = bytes.begin() + static_cast<std::ptrdiff_t>(offset);
            return Bytes(from, from + static_cast<std::ptrdiff_t>(count));
          }};
}

}  // namespace qmpipe::testing
