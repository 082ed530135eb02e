#include "formats/pmtiles/directory.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <optional>

#include "formats/bytes/gzip.h"
#include "formats/pmtiles/id.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

constexpr int kDirectoryGzipLevel = 9;
// The reference writer's smallest leaf: some 10 kB as stored, one request.
constexpr std::size_t kSmallestLeafEntries = 4096;
// Of one directory, uncompressed. The usual ones have some 100 kB.
constexpr std::uint64_t kLargestDirectoryBytes = std::uint64_t{64} << 20U;
// Every entry is four numbers of a byte at least.
constexpr std::size_t kSmallestEntryBytes = 4;
// Allowed in a file of any size; with runs, few bytes can stand for many tiles.
constexpr std::uint64_t kAlwaysAllowedTiles = std::uint64_t{1} << 24U;

void put_varint(std::vector<std::uint8_t>& bytes, std::uint64_t value) {
  while (value >= 0x80) {
    bytes.push_back(static_cast<std::uint8_t>(value | 0x80U));
    value >>= 7U;
  }
  bytes.push_back(static_cast<std::uint8_t>(value));
}

class VarintReader {
 public:
  explicit VarintReader(std::span<const std::uint8_t> bytes) : rest_(bytes) {}

  std::size_t bytes_left() const { return rest_.size(); }
  // None at the end, or when the number exceeds `largest`.
  std::optional<std::uint64_t> next(std::uint64_t largest) {
    std::uint64_t value = 0;
    for (unsigned shift = 0; shift < 64; shift += 7) {
      if (rest_.empty()) return std::nullopt;
      const std::uint64_t digit = rest_.front() & 0x7FU;
      const bool is_last = rest_.front() < 0x80;
      rest_ = rest_.subspan(1);
      if ((digit << shift) >> shift != digit) return std::nullopt;
      value |= digit << shift;
      if (is_last) return value <= largest ? std::optional(value) : std::nullopt;
    }
    return std::nullopt;
  }

 private:
  std::span<const std::uint8_t> rest_;
};

constexpr std::uint64_t kMaxUint32 = std::numeric_limits<std::uint32_t>::max();

// The four columns, in the order of the file; an empty string, or what is wrong.
std::string read_columns(VarintReader& reader, std::vector<PmtilesEntry>& entries) {
  const std::uint64_t end_id = first_archive_id(kDeepestArchiveZoom + 1);
  std::uint64_t id = 0;
  for (std::size_t k = 0; k < entries.size(); ++k) {
    const auto step = reader.next(end_id - 1 - id);
    if (!step) return fmt::format("the id of entry {} is missing or too large", k);
    if (*step == 0 && k > 0) return fmt::format("entry {} has the id of the one before", k);
    id += *step;
    entries[k].id = id;
  }
  for (std::size_t k = 0; k < entries.size(); ++k) {
    const auto run = reader.next(kMaxUint32);
    if (!run) return fmt::format("the run of entry {} is missing or too large", k);
    entries[k].run_length = static_cast<std::uint32_t>(*run);
  }
  for (std::size_t k = 0; k < entries.size(); ++k) {
    const auto bytes = reader.next(kMaxUint32);
    if (!bytes) return fmt::format("the length of entry {} is missing or too large", k);
    if (*bytes == 0) return fmt::format("entry {} has no bytes", k);
    entries[k].bytes = static_cast<std::uint32_t>(*bytes);
  }
  for (std::size_t k = 0; k < entries.size(); ++k) {
    // Far below 2^64, so that offset + bytes cannot overflow.
    const auto code = reader.next(std::uint64_t{1} << 62U);
    if (!code) return fmt::format("the offset of entry {} is missing or too large", k);
    if (*code == 0 && k == 0) return "the first entry continues one before it";
    entries[k].offset = *code > 0 ? *code - 1 : entries[k - 1].offset + entries[k - 1].bytes;
    if (entries[k].offset > std::uint64_t{1} << 62U) return "the offsets are too large";
  }
  return "";
}

bool lies_within(const PmtilesEntry& entry, const PmtilesSection& section) {
  return entry.offset <= section.bytes && entry.bytes <= section.bytes - entry.offset;
}

// Follows the leaves and collects the entries of tiles.
class IndexReader {
 public:
  IndexReader(const ReadFileBytes& read, const PmtilesHeader& header, std::uint64_t file_bytes)
      : read_(read), header_(header), most_tiles_(kAlwaysAllowedTiles + file_bytes) {}

  // An empty string, or what is wrong.
  std::string add_directory(const PmtilesSection& section, std::int32_t depth) {
    if (section.bytes > kLargestDirectoryBytes) {
      return in_directory(section, fmt::format("it has {} bytes, more than the {} allowed",
                                               section.bytes, kLargestDirectoryBytes));
    }
    auto stored = read_(section.offset, section.bytes);
    if (!stored) return stored.error().message;
    const auto plain = plain_pmtiles_section(std::move(*stored), header_.directory_compression,
                                             kLargestDirectoryBytes);
    if (!plain) return in_directory(section, plain.error().message);
    const auto entries = read_pmtiles_directory(*plain);
    if (!entries) return in_directory(section, entries.error().message);
    for (const PmtilesEntry& entry : *entries) {
      if (entry.id < next_id_) {
        return in_directory(
            section, fmt::format("tile id {} stands there after {}", entry.id, next_id_ - 1));
      }
      std::string wrong = entry.run_length > 0 ? add_tiles(entry) : add_leaf(entry, depth);
      if (!wrong.empty()) return wrong;
    }
    return "";
  }

  std::vector<PmtilesEntry> take() { return std::move(tiles_); }

 private:
  static std::string in_directory(const PmtilesSection& section, const std::string& what) {
    return fmt::format("the directory at byte {}: {}", section.offset, what);
  }

  std::string add_tiles(const PmtilesEntry& entry) {
    if (!lies_within(entry, header_.tiles)) {
      return fmt::format("tile id {} lies outside the section of tiles", entry.id);
    }
    tile_count_ += entry.run_length;
    if (tile_count_ > most_tiles_) {
      return fmt::format("it lists more than {} tiles, too many for its size", most_tiles_);
    }
    next_id_ = entry.id + entry.run_length;
    tiles_.push_back(entry);
    return "";
  }

  std::string add_leaf(const PmtilesEntry& entry, std::int32_t depth) {
    if (depth == kDeepestLeaf) {
      return fmt::format("its directories are nested deeper than {} levels", kDeepestLeaf);
    }
    if (!lies_within(entry, header_.leaves)) {
      return fmt::format("the directory of tile id {} lies outside its section", entry.id);
    }
    next_id_ = entry.id;
    return add_directory({.offset = header_.leaves.offset + entry.offset, .bytes = entry.bytes},
                         depth + 1);
  }

  const ReadFileBytes& read_;
  const PmtilesHeader& header_;
  const std::uint64_t most_tiles_;
  std::uint64_t next_id_ = 0;
  std::uint64_t tile_count_ = 0;
  std::vector<PmtilesEntry> tiles_;
};

std::vector<std::uint8_t> packed_directory(std::span<const PmtilesEntry> entries) {
  return gzip_compress(write_pmtiles_directory(entries), kDirectoryGzipLevel);
}

PmtilesDirectories directories_with_leaves(std::span<const PmtilesEntry> entries,
                                           std::size_t leaf_entries) {
  PmtilesDirectories directories;
  std::vector<PmtilesEntry> root;
  for (std::size_t first = 0; first < entries.size(); first += leaf_entries) {
    const auto part = entries.subspan(first, std::min(leaf_entries, entries.size() - first));
    const std::vector<std::uint8_t> leaf = packed_directory(part);
    root.push_back({.id = part.front().id,
                    .offset = directories.leaves.size(),
                    .bytes = static_cast<std::uint32_t>(leaf.size()),
                    .run_length = 0});
    directories.leaves.insert(directories.leaves.end(), leaf.begin(), leaf.end());
  }
  directories.root = packed_directory(root);
  return directories;
}

}  // namespace

std::vector<std::uint8_t> write_pmtiles_directory(std::span<const PmtilesEntry> entries) {
  QMPIPE_CHECK(!entries.empty());
  std::vector<std::uint8_t> bytes;
  put_varint(bytes, entries.size());
  std::uint64_t last_id = 0;
  for (const PmtilesEntry& entry : entries) {
    QMPIPE_CHECK(&entry == &entries.front() || entry.id > last_id);
    put_varint(bytes, entry.id - last_id);
    last_id = entry.id;
  }
  for (const PmtilesEntry& entry : entries) put_varint(bytes, entry.run_length);
  for (const PmtilesEntry& entry : entries) {
    QMPIPE_CHECK(entry.bytes > 0);
    put_varint(bytes, entry.bytes);
  }
  for (std::size_t k = 0; k < entries.size(); ++k) {
    const bool continues =
        k > 0 && entries[k].offset == entries[k - 1].offset + entries[k - 1].bytes;
    put_varint(bytes, continues ? 0 : entries[k].offset + 1);
  }
  return bytes;
}

Result<std::vector<PmtilesEntry>> read_pmtiles_directory(std::span<const std::uint8_t> bytes) {
  VarintReader reader(bytes);
  const auto count = reader.next(std::numeric_limits<std::uint64_t>::max());
  if (!count) return Error{"the number of entries is missing or too large"};
  if (*count == 0) return Error{"it has no entries"};
  // Before any memory is taken for them.
  if (*count > reader.bytes_left() / kSmallestEntryBytes) {
    return Error{fmt::format("{} entries do not fit {} bytes", *count, reader.bytes_left())};
  }
  std::vector<PmtilesEntry> entries(static_cast<std::size_t>(*count));
  const std::string wrong = read_columns(reader, entries);
  if (!wrong.empty()) return Error{wrong};
  if (reader.bytes_left() > 0) {
    return Error{fmt::format("{} bytes follow the entries", reader.bytes_left())};
  }
  return entries;
}

PmtilesDirectories write_pmtiles_directories(std::span<const PmtilesEntry> entries) {
  const auto fits = [](const PmtilesDirectories& directories) {
    return kPmtilesHeaderBytes + directories.root.size() < kPmtilesRootEnd;
  };
  PmtilesDirectories directories;
  // More hardly ever fit: the length of a tile takes a byte of its own.
  if (entries.size() < kPmtilesRootEnd) directories.root = packed_directory(entries);
  std::size_t leaf_entries = kSmallestLeafEntries;
  while (directories.root.empty() || !fits(directories)) {
    directories = directories_with_leaves(entries, leaf_entries);
    leaf_entries += leaf_entries / 2;
  }
  return directories;
}

Result<PmtilesIndex> read_pmtiles_index(const ReadFileBytes& read, std::uint64_t file_bytes) {
  const auto start = read(0, std::min(file_bytes, kPmtilesHeaderBytes));
  if (!start) return start.error();
  const auto header = read_pmtiles_header(*start, file_bytes);
  if (!header) return header.error();
  IndexReader reader(read, *header, file_bytes);
  const std::string wrong = reader.add_directory(header->root, 0);
  if (!wrong.empty()) return Error{wrong};
  return PmtilesIndex{.header = *header, .entries = reader.take()};
}

Result<std::vector<std::uint8_t>> plain_pmtiles_section(std::vector<std::uint8_t> stored,
                                                        PmtilesCompression compression,
                                                        std::uint64_t limit_bytes) {
  if (stored.size() > limit_bytes) {
    return Error{
        fmt::format("it has {} bytes, more than the {} allowed", stored.size(), limit_bytes)};
  }
  if (compression != PmtilesCompression::kGzip) return stored;
  return gzip_decompress(stored, static_cast<std::size_t>(limit_bytes));
}

}  // namespace qmpipe
