#include "formats/bytes/seal.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <span>

#include "formats/bytes/file_bytes.h"
#include "formats/bytes/hash64.h"
#include "formats/bytes/little_endian.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

constexpr std::array<std::uint8_t, 8> kSealMagic = {'Q', 'M', 'P', 'S', 'E', 'A', 'L', '1'};
constexpr std::uint64_t kSealSeed = 0x716D706970650001ULL;
constexpr std::size_t kWord = sizeof(std::uint64_t);
constexpr std::size_t kRangeBytes = 2 * kWord;
// Hash of the parts, bytes before the seal, count, hash of the seal, magic.
constexpr std::size_t kTailBytes = 5 * kWord;

std::vector<ByteRange> outside(std::vector<ByteRange> payload, std::uint64_t file_bytes) {
  std::sort(payload.begin(), payload.end(),
            [](const ByteRange& a, const ByteRange& b) { return a.offset < b.offset; });
  std::vector<ByteRange> parts;
  std::uint64_t at = 0;
  for (const ByteRange& range : payload) {
    QMPIPE_CHECK(range.offset >= at && range.bytes <= file_bytes &&
                 range.offset <= file_bytes - range.bytes);
    if (range.offset > at) parts.push_back({.offset = at, .bytes = range.offset - at});
    at = range.offset + range.bytes;
  }
  if (at < file_bytes) parts.push_back({.offset = at, .bytes = file_bytes - at});
  return parts;
}

}  // namespace

void append_seal(std::vector<std::uint8_t>& file, std::vector<ByteRange> payload) {
  const std::size_t body_bytes = file.size();
  const std::vector<ByteRange> parts = outside(std::move(payload), body_bytes);
  std::uint64_t hash = kSealSeed;
  for (const ByteRange& part : parts) {
    hash = hash64(std::span(file).subspan(part.offset, part.bytes), hash);
  }
  for (const ByteRange& part : parts) {
    append_little_endian(file, part.offset);
    append_little_endian(file, part.bytes);
  }
  append_little_endian(file, hash);
  append_little_endian(file, body_bytes);
  append_little_endian(file, parts.size());
  append_little_endian(file, hash64(std::span(file).subspan(body_bytes), kSealSeed));
  file.insert(file.end(), kSealMagic.begin(), kSealMagic.end());
}

std::span<const std::uint8_t> without_seal(std::span<const std::uint8_t> file) {
  QMPIPE_CHECK(file.size() >= kTailBytes);
  const std::uint8_t* tail = file.data() + file.size() - kTailBytes;
  const auto body_bytes = load_little_endian<std::uint64_t>(tail + kWord);
  QMPIPE_CHECK(body_bytes <= file.size());
  return file.first(body_bytes);
}

std::optional<Error> check_seal(const std::filesystem::path& path) {
  const auto refused = [&path](const std::string& cause) {
    return Error{fmt::format("{}: {}", path.string(), cause)};
  };
  std::error_code code;
  const std::uint64_t file_bytes = std::filesystem::file_size(path, code);
  if (code) return refused(code.message());
  if (file_bytes < kTailBytes) return refused("the file is cut off or was never finished");
  const auto tail = read_file_range(path, file_bytes - kTailBytes, kTailBytes);
  if (!tail) return tail.error();
  if (!std::equal(kSealMagic.begin(), kSealMagic.end(), tail->end() - kSealMagic.size())) {
    return refused("the file is cut off, was never finished, or is none of qmpipe's");
  }
  const auto parts_hash = load_little_endian<std::uint64_t>(tail->data());
  const auto body_bytes = load_little_endian<std::uint64_t>(tail->data() + kWord);
  const auto count = load_little_endian<std::uint64_t>(tail->data() + 2 * kWord);
  const auto seal_hash = load_little_endian<std::uint64_t>(tail->data() + 3 * kWord);
  const std::uint64_t room_bytes = file_bytes - kTailBytes;
  if (count > room_bytes / kRangeBytes || body_bytes != room_bytes - count * kRangeBytes) {
    return refused("the file is damaged: its seal does not fit its length");
  }
  const auto seal = read_file_range(path, body_bytes, count * kRangeBytes + 3 * kWord);
  if (!seal) return seal.error();
  if (hash64(*seal, kSealSeed) != seal_hash) return refused("the file is damaged in its seal");
  std::uint64_t hash = kSealSeed;
  std::uint64_t at = 0;
  for (std::uint64_t k = 0; k < count; ++k) {
    const std::uint8_t* entry = seal->data() + k * kRangeBytes;
    const auto offset = load_little_endian<std::uint64_t>(entry);
    const auto bytes = load_little_endian<std::uint64_t>(entry + kWord);
    // Overlapping parts would have the same bytes read again and again.
    if (bytes == 0 || offset < at || offset > body_bytes || bytes > body_bytes - offset) {
      return refused("the file is damaged: the parts under its seal are out of order");
    }
    at = offset + bytes;
    const auto part = read_file_range(path, offset, bytes);
    if (!part) return part.error();
    hash = hash64(*part, hash);
  }
  if (hash != parts_hash) return refused("the file is damaged in its index");
  return std::nullopt;
}

}  // namespace qmpipe
