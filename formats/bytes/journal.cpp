#include "formats/bytes/journal.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <optional>

#include "formats/bytes/file_bytes.h"
#include "formats/bytes/hash64.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

constexpr std::size_t kDigits = 16;
constexpr std::uint64_t kJournalSeed = 0x716D706970650002ULL;
// Days of checkpoints every second stay below it.
constexpr std::size_t kMostJournalBytes = std::size_t{1} << 30U;

std::uint64_t hash_of(const std::string& text, std::uint64_t seed) {
  return hash64({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, seed);
}

// The text of a line without its newline whose hash fits, whatever stood before it.
struct SplitLine {
  std::uint64_t hash = 0;
  std::string text;
};

std::optional<SplitLine> split_line(std::span<const std::uint8_t> line) {
  if (line.size() <= kDigits || line[kDigits] != ' ') return std::nullopt;
  SplitLine split;
  for (const std::uint8_t digit : line.first(kDigits)) {
    const bool is_number = digit >= '0' && digit <= '9';
    if (!is_number && (digit < 'a' || digit > 'f')) return std::nullopt;
    split.hash =
        split.hash << 4U | static_cast<unsigned>(is_number ? digit - '0' : digit - 'a' + 10);
  }
  split.text.assign(line.begin() + kDigits + 1, line.end());
  return split;
}

// 0 or errno.
int write_whole(int descriptor, std::string_view bytes, std::size_t offset) {
  while (!bytes.empty()) {
    const ssize_t written =
        ::pwrite(descriptor, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return errno;
    bytes.remove_prefix(static_cast<std::size_t>(written));
    offset += static_cast<std::size_t>(written);
  }
  return ::fdatasync(descriptor) == 0 ? 0 : errno;
}

}  // namespace

Result<JournalContent> parse_journal(std::span<const std::uint8_t> bytes) {
  JournalContent content{.lines = {}, .sound_bytes = 0, .last_hash = kJournalSeed};
  // A line's hash stands on the one before it, which is known from its digits even when its text is
  // damaged.
  std::optional<std::size_t> damaged_line;
  std::optional<std::uint64_t> seed = kJournalSeed;
  std::size_t number = 0;
  for (std::size_t at = 0; at < bytes.size();) {
    ++number;
    const auto end = std::find(bytes.begin() + static_cast<std::ptrdiff_t>(at), bytes.end(), '\n');
    if (end == bytes.end()) break;
    const auto length = static_cast<std::size_t>(end - bytes.begin()) - at;
    const std::optional<SplitLine> split = split_line(bytes.subspan(at, length));
    const bool is_sound = split && seed && hash_of(split->text, *seed) == split->hash;
    if (is_sound && damaged_line) {
      return Error{fmt::format("line {} is damaged, though later ones are sound", *damaged_line)};
    }
    if (!is_sound && !damaged_line) damaged_line = number;
    seed = split ? std::optional(split->hash) : std::nullopt;
    at += length + 1;
    if (!is_sound) continue;
    content.lines.push_back(split->text);
    content.sound_bytes = at;
    content.last_hash = split->hash;
  }
  return content;
}

Journal::Journal(std::filesystem::path path, int descriptor)
    : path_(std::move(path)), descriptor_(descriptor) {}

Journal::~Journal() { ::close(descriptor_); }

Result<std::unique_ptr<Journal>> Journal::open(const std::filesystem::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (descriptor < 0) throw_io_error("cannot open the journal", path, errno);
  std::unique_ptr<Journal> journal(new Journal(path, descriptor));
  journal->lock_file_ = lock_open_file(descriptor, path);
  const Result<std::vector<std::uint8_t>> bytes = read_file_bytes(path, kMostJournalBytes);
  if (!bytes) return bytes.error();
  Result<JournalContent> content = parse_journal(*bytes);
  if (!content) return Error{fmt::format("{}: {}", path.string(), content.error().message)};
  journal->content_ = std::move(content.value());
  if (journal->content_.sound_bytes < bytes->size() &&
      ::ftruncate(descriptor, static_cast<off_t>(journal->content_.sound_bytes)) != 0) {
    throw_io_error("cannot write the journal", path, errno);
  }
  sync_folder_of(path);
  return journal;
}

void Journal::clear() {
  if (::ftruncate(descriptor_, 0) != 0 || ::fdatasync(descriptor_) != 0) {
    throw_io_error("cannot write the journal", path_, errno);
  }
  content_ = {.lines = {}, .sound_bytes = 0, .last_hash = kJournalSeed};
}

void Journal::append(const std::string& text) {
  QMPIPE_CHECK(text.find('\n') == std::string::npos);
  const std::uint64_t hash = hash_of(text, content_.last_hash);
  const std::string line = fmt::format("{:016x} {}\n", hash, text);
  if (const int error = write_whole(descriptor_, line, content_.sound_bytes); error != 0) {
    // Opening drops a torn line too; this spares the next append from standing behind one.
    static_cast<void>(::ftruncate(descriptor_, static_cast<off_t>(content_.sound_bytes)));
    throw_io_error("cannot write the journal", path_, error);
  }
  content_.sound_bytes += line.size();
  content_.last_hash = hash;
}

}  // namespace qmpipe
