#include "formats/hdf5/segment_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <optional>
#include <string>
#include <string_view>

#include "formats/bytes/file_bytes.h"
#include "formats/bytes/folders.h"

namespace qmpipe {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kSuffix = ".h5";

std::string_view prefix_of(SegmentKind kind) {
  switch (kind) {
    case SegmentKind::kLattice:
      return "lattice-";
    case SegmentKind::kBorders:
      return "borders-";
  }
  return {};
}

std::optional<std::int32_t> segment_number(const fs::path& path, SegmentKind kind) {
  const std::string_view prefix = prefix_of(kind);
  const std::string name = path.filename().string();
  if (!name.starts_with(prefix) || !name.ends_with(kSuffix)) return std::nullopt;
  const char* end = name.data() + name.size() - kSuffix.size();
  std::int32_t number = 0;
  const auto parsed = std::from_chars(name.data() + prefix.size(), end, number);
  // One name for one number: nothing else would be found again.
  if (parsed.ec != std::errc() || parsed.ptr != end || number < 0 ||
      segment_path(path.parent_path(), kind, number) != path) {
    return std::nullopt;
  }
  return number;
}

bool is_torn_segment(const fs::path& path, SegmentKind kind) {
  const std::string name = path.filename().string();
  return name.starts_with(prefix_of(kind)) && name.ends_with(kTemporarySuffix);
}

}  // namespace

fs::path segment_path(const fs::path& folder, SegmentKind kind, std::int32_t number) {
  return folder / fmt::format("{}{:06}{}", prefix_of(kind), number, kSuffix);
}

std::vector<std::int32_t> segment_numbers(const fs::path& folder, SegmentKind kind) {
  std::vector<std::int32_t> numbers;
  for (const fs::directory_entry& file : entries_of(folder)) {
    if (const auto number = segment_number(file.path(), kind)) numbers.push_back(*number);
  }
  std::sort(numbers.begin(), numbers.end());
  return numbers;
}

Result<std::int32_t> count_without_gaps(const fs::path& folder, SegmentKind kind) {
  std::int32_t expected = 0;
  for (const std::int32_t number : segment_numbers(folder, kind)) {
    if (number != expected) {
      return Error{fmt::format("{}: the file is missing, though later ones are there; {}",
                               segment_path(folder, kind, expected).string(), kStartOver)};
    }
    ++expected;
  }
  return expected;
}

void prepare_segment_folder(const fs::path& folder, SegmentKind kind) {
  make_folders(folder);
  for (const fs::directory_entry& file : entries_of(folder)) {
    if (is_torn_segment(file.path(), kind)) remove_file(file.path());
  }
}

void remove_segments(const fs::path& folder, SegmentKind kind) {
  for (const fs::directory_entry& file : entries_of(folder)) {
    const fs::path& path = file.path();
    if (is_torn_segment(path, kind) || segment_number(path, kind)) remove_file(path);
  }
}

}  // namespace qmpipe
