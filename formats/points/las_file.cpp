#include "formats/points/las_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "formats/bytes/little_endian.h"

namespace qmpipe {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t kOldHeaderBytes = 227;  // 1.0 to 1.2
constexpr std::size_t kHeaderBytes13 = 235;
constexpr std::size_t kHeaderBytes14 = 375;
constexpr std::size_t kRecordHeaderBytes = 54;
constexpr std::size_t kLongRecordHeaderBytes = 60;
// No CRS is longer; a length from outside must not decide how much memory is taken.
constexpr std::uint64_t kMostLasCrsBytes = 1 << 20;
constexpr std::uint64_t kRecordBytesAtOnce = 1 << 20;
constexpr std::array<std::uint32_t, 11> kLeastRecordBytes = {20, 28, 26, 34, 57, 63,
                                                             30, 36, 38, 59, 67};

template <class T>
T load(const Bytes& bytes, std::size_t at) {
  return load_little_endian<T>(bytes.data() + at);
}

// Where records lie whose ids may be the CRS's.
struct Records {
  std::uint64_t begin = 0;
  std::uint64_t end = 0;
  std::uint64_t count = 0;
  std::size_t header_bytes = kRecordHeaderBytes;
};

struct Layout {
  LasHeader header;
  Records records;
  Records long_records;
};

void take_crs(std::uint16_t id, const Bytes& payload, LasCrs& crs) {
  const auto text = [&] {
    // Padded with zeros, or ended by one.
    return std::string(payload.begin(), std::find(payload.begin(), payload.end(), 0));
  };
  switch (id) {
    case 2112:
      crs.wkt = text();
      break;
    case 34735:
      crs.geo_keys.resize(payload.size() / 2);
      for (std::size_t k = 0; k < crs.geo_keys.size(); ++k) {
        crs.geo_keys[k] = load<std::uint16_t>(payload, 2 * k);
      }
      break;
    case 34736:
      crs.geo_doubles.resize(payload.size() / 8);
      for (std::size_t k = 0; k < crs.geo_doubles.size(); ++k) {
        crs.geo_doubles[k] = load<double>(payload, 8 * k);
      }
      break;
    case 34737:
      crs.geo_text = text();
      break;
    default:
      break;
  }
}

bool is_crs_record(const Bytes& record_header) {
  constexpr std::string_view kUser = "LASF_Projection";
  return std::equal(kUser.begin(), kUser.end(), record_header.begin() + 2) &&
         record_header[2 + kUser.size()] == 0;
}

std::optional<Error> read_crs_records(const ByteSource& source, const Records& records,
                                      LasCrs& crs) {
  std::uint64_t at = records.begin;
  for (std::uint64_t k = 0; k < records.count; ++k) {
    if (records.end - at < records.header_bytes) {
      return Error{
          fmt::format("only {} of its {} variable length records are there", k, records.count)};
    }
    const auto record = source.read(at, records.header_bytes);
    if (!record) return record.error();
    at += records.header_bytes;
    const std::uint64_t length = records.header_bytes == kRecordHeaderBytes
                                     ? load<std::uint16_t>(*record, 20)
                                     : load<std::uint64_t>(*record, 20);
    if (length > records.end - at) {
      return Error{fmt::format("variable length record {} of {} says {} bytes, but {} are left", k,
                               records.count, length, records.end - at)};
    }
    if (is_crs_record(*record) && length <= kMostLasCrsBytes) {
      const auto payload = source.read(at, static_cast<std::size_t>(length));
      if (!payload) return payload.error();
      take_crs(load<std::uint16_t>(*record, 18), *payload, crs);
    }
    at += length;
  }
  return std::nullopt;
}

std::size_t least_header_bytes(int minor_version) {
  if (minor_version >= 4) return kHeaderBytes14;
  return minor_version == 3 ? kHeaderBytes13 : kOldHeaderBytes;
}

std::optional<Error> check_signature(const Bytes& bytes, std::uint64_t size_bytes) {
  if (bytes.size() < kLasSignature.size() ||
      !std::equal(kLasSignature.begin(), kLasSignature.end(), bytes.begin())) {
    return Error{"it does not begin with LASF, as a LAS file does"};
  }
  if (bytes.size() < kOldHeaderBytes) {
    return Error{fmt::format("it ends after {} bytes, within its header", size_bytes)};
  }
  if (bytes[24] != 1 || bytes[25] > 4) {
    return Error{fmt::format("it is LAS {}.{}; 1.0 to 1.4 are known", bytes[24], bytes[25])};
  }
  const unsigned format = bytes[104];
  if (format >= 64) {
    return Error{"its points are compressed (LAZ)"};
  }
  if (format >= kLeastRecordBytes.size()) {
    return Error{fmt::format("its point format is {}; 0 to 10 are known", format)};
  }
  return std::nullopt;
}

std::optional<Error> take_scales(const Bytes& bytes, LasHeader& header) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double scale = load<double>(bytes, 131 + 8 * axis);
    const double offset = load<double>(bytes, 155 + 8 * axis);
    const char name = "xyz"[axis];
    if (!std::isfinite(scale) || scale <= 0) {
      return Error{fmt::format("its scale of {} is {}, not a number above 0", name, scale)};
    }
    if (!std::isfinite(offset) || !std::isfinite(std::abs(offset) + scale * 0x1p32)) {
      return Error{
          fmt::format("its offset of {} is {} and its scale {}: too large", name, offset, scale)};
    }
    header.scale[axis] = scale;
    header.offset[axis] = offset;
  }
  return std::nullopt;
}

// Writers before 1.4 know the 32-bit count only, and some of 1.4 fill in one of the two.
Result<std::uint64_t> point_count(const Bytes& bytes, int minor_version) {
  const std::uint64_t old_count = load<std::uint32_t>(bytes, 107);
  if (minor_version < 4) return old_count;
  const auto count = load<std::uint64_t>(bytes, 247);
  if (count == 0) return old_count;
  if (old_count != 0 && old_count != count) {
    return Error{
        fmt::format("its header contradicts itself: {} points and {} points", old_count, count)};
  }
  return count;
}

std::optional<Error> take_places(const Bytes& bytes, std::uint64_t size_bytes, Layout& layout) {
  LasHeader& header = layout.header;
  const std::uint64_t header_bytes = load<std::uint16_t>(bytes, 94);
  const std::size_t least = least_header_bytes(header.minor_version);
  if (header_bytes < least || bytes.size() < least) {
    return Error{fmt::format("its header has {} bytes; LAS 1.{} has at least {}",
                             std::min<std::uint64_t>(header_bytes, bytes.size()),
                             header.minor_version, least)};
  }
  if (header.points_offset < header_bytes || header.points_offset > size_bytes) {
    return Error{
        fmt::format("its points begin at byte {}, but its header has {} bytes and the file {}",
                    header.points_offset, header_bytes, size_bytes)};
  }
  const std::uint32_t least_record =
      kLeastRecordBytes[static_cast<std::size_t>(header.point_format)];
  if (header.record_bytes < least_record) {
    return Error{fmt::format("a point has {} bytes; format {} has at least {}", header.record_bytes,
                             header.point_format, least_record)};
  }
  const std::uint64_t there = (size_bytes - header.points_offset) / header.record_bytes;
  if (there < header.point_count) {
    return Error{
        fmt::format("it is cut off: {} of its {} points are there", there, header.point_count)};
  }
  layout.records = {
      .begin = header_bytes, .end = header.points_offset, .count = load<std::uint32_t>(bytes, 100)};
  if (header.minor_version < 4) return std::nullopt;
  const std::uint64_t count = load<std::uint32_t>(bytes, 243);
  const auto begin = load<std::uint64_t>(bytes, 235);
  if (count > 0 && (begin < header.points_offset || begin > size_bytes)) {
    return Error{fmt::format("its extended records begin at byte {} of {}", begin, size_bytes)};
  }
  layout.long_records = {
      .begin = begin, .end = size_bytes, .count = count, .header_bytes = kLongRecordHeaderBytes};
  return std::nullopt;
}

LasPoint decode_point(const std::uint8_t* record, const LasHeader& header) {
  LasPoint point;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    point.at[axis] = load_little_endian<std::int32_t>(record + 4 * axis);
  }
  if (header.point_format >= 6) {
    point.classification = record[16];
    point.is_withheld = (record[15] & 4U) != 0;
    point.is_noise = point.classification == 7 || point.classification == 18;
  } else if (header.minor_version == 0) {
    // The flags in the upper bits came with 1.1.
    point.classification = record[15];
    point.is_noise = point.classification == 7;
  } else {
    point.classification = record[15] & 31U;
    point.is_withheld = (record[15] & 128U) != 0;
    point.is_noise = point.classification == 7;
  }
  return point;
}

}  // namespace

Result<LasHeader> read_las_header(const ByteSource& source) {
  const auto read = source.read(
      0, static_cast<std::size_t>(std::min<std::uint64_t>(source.size_bytes, kHeaderBytes14)));
  if (!read) return read.error();
  const Bytes& bytes = *read;
  if (auto error = check_signature(bytes, source.size_bytes)) return std::move(*error);
  Layout layout;
  LasHeader& header = layout.header;
  header.minor_version = bytes[25];
  header.point_format = bytes[104];
  header.record_bytes = load<std::uint16_t>(bytes, 105);
  header.points_offset = load<std::uint32_t>(bytes, 96);
  if (bytes.size() < least_header_bytes(header.minor_version)) {
    return Error{fmt::format("it ends after {} bytes, within its header", source.size_bytes)};
  }
  const auto count = point_count(bytes, header.minor_version);
  if (!count) return count.error();
  header.point_count = *count;
  if (auto error = take_scales(bytes, header)) return std::move(*error);
  if (auto error = take_places(bytes, source.size_bytes, layout)) return std::move(*error);
  for (const Records& records : {layout.records, layout.long_records}) {
    if (auto error = read_crs_records(source, records, header.crs)) return std::move(*error);
  }
  return std::move(header);
}

std::optional<Error> for_each_las_point(const ByteSource& source, const LasHeader& header,
                                        const std::function<void(const LasPoint&)>& visit) {
  const std::uint64_t most = std::max<std::uint64_t>(1, kRecordBytesAtOnce / header.record_bytes);
  for (std::uint64_t first = 0; first < header.point_count;) {
    const std::uint64_t count = std::min(most, header.point_count - first);
    const auto bytes = source.read(header.points_offset + first * header.record_bytes,
                                   static_cast<std::size_t>(count * header.record_bytes));
    if (!bytes) return bytes.error();
    for (std::uint64_t k = 0; k < count; ++k) {
      visit(decode_point(bytes->data() + k * header.record_bytes, header));
    }
    first += count;
  }
  return std::nullopt;
}

}  // namespace qmpipe
