#include "pipeline/run/run_record.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <vector>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"
#include "formats/bytes/folders.h"
#include "formats/hdf5/segment_files.h"
#include "formats/run_store/hdf5_border_store.h"
#include "formats/run_store/hdf5_lattice_store.h"
#include "formats/tile_sets/tile_output.h"
#include "pipeline/recipe/fingerprint.h"

namespace qmpipe {
namespace {

namespace fs = std::filesystem;

constexpr const char* kJournalName = "journal";
constexpr std::size_t kMostJournalBytes = std::size_t{1} << 30U;

void make_run_folder(const fs::path& folder) {
  make_folders(folder);
  // Else a power cut could take the folder away and leave the tiles.
  sync_folder_of(plain_path(folder));
}

void remove_stores(const fs::path& folder) {
  for (const SegmentKind kind : {SegmentKind::kLattice, SegmentKind::kBorders}) {
    remove_segments(folder, kind);
  }
  remove_survey_files(folder);
}

// Whatever else stands in a folder that the user has named is the user's.
void remove_own_files(const fs::path& folder) {
  if (!fs::exists(folder)) return;
  remove_stores(folder);
  remove_file(folder / kJournalName);
  remove_folder_if_empty(folder);
}

[[noreturn]] void refuse_run(const fs::path& folder, const std::string& cause) {
  throw IoError("cannot go on with the run in", folder.string(), cause,
                "Build with --overwrite to start over.");
}

std::unique_ptr<Journal> open_journal(const fs::path& folder) {
  make_run_folder(folder);
  auto journal = Journal::open(folder / kJournalName);
  if (!journal) refuse_run(folder, journal.error().message);
  return std::move(journal.value());
}

std::string listed(const std::vector<std::string>& sentences) {
  std::string text;
  for (const std::string& sentence : sentences) text += (text.empty() ? "" : "; ") + sentence;
  return text;
}

}  // namespace

fs::path plain_path(const fs::path& path) {
  const fs::path plain = fs::absolute(path).lexically_normal();
  return plain.has_filename() ? plain : plain.parent_path();
}

fs::path run_folder_of(const fs::path& output) {
  return plain_path(output).string() + ".qmpipe-run";
}

RunRecord::RunRecord(fs::path folder, std::unique_ptr<Journal> journal)
    : folder_(std::move(folder)), journal_(std::move(journal)) {}

RunRecord::~RunRecord() {
  try {
    const bool is_worthless = is_discarded_ || !is_worth_keeping();
    if (!is_kept_ && is_worthless && !has_begun_output()) remove_folder();
  } catch (const std::exception&) {
    // The folder cannot even be listed: left as it is.
  }
}

std::unique_ptr<RunRecord> RunRecord::open(const fs::path& folder, const std::string& fingerprint,
                                           Overwrite overwrite) {
  const bool has_journal = fs::exists(folder / kJournalName);
  if (has_journal && overwrite == Overwrite::kYes) {
    // Not under the feet of a run that is at work; whether the journal is sound does not matter.
    static_cast<void>(Journal::open(folder / kJournalName));
  }
  // Without a journal it is the rest of a run that was done and could not clear up.
  if (!has_journal || overwrite == Overwrite::kYes) {
    // Before what it counts on.
    remove_file(folder / kJournalName);
    remove_own_files(folder);
  }
  std::unique_ptr<RunRecord> record(new RunRecord(folder, open_journal(folder)));
  // Whatever is wrong with an earlier run's folder, it is the user's to remove.
  record->is_kept_ = !record->journal_->lines().empty();
  record->read_lines(fingerprint);
  // The run that began with it was killed.
  if (record->is_clearing_) remove_stores(folder);
  record->check_stores();
  record->is_kept_ = false;
  return record;
}

// While the journal is there, and held, nobody else begins.
void RunRecord::remove_folder() {
  remove_own_files(folder_);
  journal_.reset();
  // A lock file may have stood there until now.
  remove_folder_if_empty(folder_);
}

void RunRecord::refuse(const std::string& cause) const { refuse_run(folder_, cause); }

void RunRecord::read_lines(const std::string& fingerprint) {
  const std::vector<std::string>& lines = journal_->lines();
  // The first line alone promises nothing, and whose the output is was not known yet.
  resumes_ = lines.size() > 1;
  if (!resumes_) {
    journal_->clear();
    journal_->append(fingerprint);
    return;
  }
  for (std::size_t k = 1; k < lines.size(); ++k) {
    if (read_line(lines[k])) continue;
    refuse(fmt::format("line {} of its journal says nothing that this version knows", k + 1));
  }
  if (is_finished_) refuse("it is finished");
  const auto differences = fingerprint_differences(lines.front(), fingerprint);
  if (differences.empty()) return;
  throw IoError("cannot go on with the unfinished run in", folder_.string(), listed(differences),
                "Build with the same input and options as before to go on, or with --overwrite to "
                "start over.");
}

bool RunRecord::read_line(const std::string& line) try {
  const nlohmann::json object = nlohmann::json::parse(line);
  is_clearing_ = false;
  if (object.contains("output_begun")) {
    is_output_ours_ = true;
  } else if (object.contains("surveyed_zoom")) {
    surveyed_[object.at("surveyed_zoom").get<std::int32_t>()] =
        object.at("lattice_segments").get<std::int32_t>();
  } else if (object.contains("plan")) {
    plan_ = object.at("plan").dump();
  } else if (object.contains("stores_removed")) {
    surveyed_.clear();
    tiles_.border_segments = 0;
    is_clearing_ = true;
  } else if (object.contains("finished")) {
    is_finished_ = true;
  } else {
    tiles_ = {.tiles_done = object.at("tiles_done").get<std::int64_t>(),
              .border_segments = object.at("border_segments").get<std::int32_t>(),
              .report_state = object.at("report").dump()};
  }
  return true;
} catch (const nlohmann::json::exception&) {
  return false;
}

// The stores notice a gap in their segments, but not that the last ones are gone.
void RunRecord::check_stores() const {
  const auto require = [this](const char* what, std::int32_t expected, std::int32_t found) {
    if (found >= expected) return;
    refuse(fmt::format("its journal counts {} segments of the {} store, and {} are there", expected,
                       what, found));
  };
  std::int32_t lattice_segments = 0;
  for (const auto& [zoom, segments] : surveyed_) {
    lattice_segments = std::max(lattice_segments, segments);
  }
  require("lattice", lattice_segments, count_lattice_segments(folder_));
  require("border", tiles_.border_segments, count_border_segments(folder_));
}

bool RunRecord::is_worth_keeping() const {
  return !surveyed_.empty() || tiles_.tiles_done > 0 || count_lattice_segments(folder_) > 0;
}

// Whether tiles stand in the output that no checkpoint counts. Without the journal they would look like
// somebody else's.
bool RunRecord::has_begun_output() const {
  if (!is_output_ours_) return false;
  return output_.empty() || may_hold_tiles(output_);
}

bool RunRecord::is_unfinished(const fs::path& folder) {
  const auto bytes = read_file_bytes(folder / kJournalName, kMostJournalBytes);
  if (!bytes) return fs::exists(folder / kJournalName);
  const auto content = parse_journal(*bytes);
  if (!content) return true;
  // A line that is no JSON contains nothing.
  return content->lines.empty() ||
         !nlohmann::json::parse(content->lines.back(), nullptr, false).contains("finished");
}

void RunRecord::begin_output(const fs::path& output) {
  output_ = output;
  if (!is_output_ours_) journal_->append(nlohmann::json{{"output_begun", true}}.dump());
  is_output_ours_ = true;
}

std::optional<std::int32_t> RunRecord::coarsest_surveyed() const {
  if (surveyed_.empty()) return std::nullopt;
  return surveyed_.begin()->first;
}

std::int32_t RunRecord::coarsest_on_disk(std::int32_t sampling_zoom) const {
  if (!surveyed_.empty()) return surveyed_.begin()->first;
  return count_lattice_segments(folder_) > 0 ? sampling_zoom : kMaxZoom + 1;
}

SurveyedZoom RunRecord::surveyed(std::int32_t zoom, const TilingScheme& scheme) const {
  auto surveyed = read_survey_file(survey_file_path(folder_, zoom), zoom, scheme);
  if (surveyed) return std::move(surveyed.value());
  refuse(surveyed.error().message);
}

void RunRecord::add_surveyed(std::int32_t zoom, const SurveyedZoom& surveyed) {
  write_survey_file(survey_file_path(folder_, zoom), zoom, surveyed);
  const std::int32_t segments = count_lattice_segments(folder_);
  journal_->append(nlohmann::json{{"surveyed_zoom", zoom}, {"lattice_segments", segments}}.dump());
  surveyed_[zoom] = segments;
}

void RunRecord::set_plan(const std::string& plan) {
  const nlohmann::json parsed = nlohmann::json::parse(plan);
  const std::string text = parsed.dump();
  if (plan_ && *plan_ != text) {
    refuse("the survey finds other tiles or heights than before, so the input was changed");
  }
  if (!plan_) journal_->append(nlohmann::json{{"plan", parsed}}.dump());
  plan_ = text;
}

void RunRecord::add_tiles(const TileCheckpoint& checkpoint) {
  journal_->append(nlohmann::json{{"tiles_done", checkpoint.tiles_done},
                                  {"border_segments", checkpoint.border_segments},
                                  {"report", nlohmann::json::parse(checkpoint.report_state)}}
                       .dump());
  tiles_ = checkpoint;
}

void RunRecord::finish(bool keep) {
  if (keep) {
    journal_->append(nlohmann::json{{"finished", true}}.dump());
    is_kept_ = true;
    return;
  }
  // First of all: a crash must not leave a journal that counts on what is gone.
  journal_->append(nlohmann::json{{"stores_removed", true}}.dump());
  remove_folder();
}

}  // namespace qmpipe
