// What a run has finished, kept beside the output so that another run can go on from there.
//
// The run folder holds a journal (formats/bytes/journal.h) and the stores' segments. The journal's lines
// are JSON objects: first the run's fingerprint, then that the output was found empty and is the run's,
// then one for each zoom whose survey is on disk, one for the plan of the mesh pass, and one for each
// checkpoint, which counts the tiles that are safe: the first n of the schedule, whose order never
// changes. When all is done, a line says
// that the folder is kept, or that its stores no longer count because they are being removed: a run
// that is killed meanwhile surveys again, and finds all tiles done.
// Guarantees: nothing is counted before it is on disk. What a crash cut off is done again. Of the
// folder, only files of a run are ever removed.
// Used by one thread at a time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "formats/bytes/journal.h"
#include "formats/run_store/survey_file.h"
#include "formats/tile_sets/folder_sink.h"

namespace qmpipe {

struct TileCheckpoint {
  std::int64_t tiles_done = 0;
  std::int32_t border_segments = 0;
  std::string report_state;  // pipeline/build/report_state.h
};

class RunRecord {
 public:
  // Goes on with the run that the folder tells of, or starts one; with kYes always starts one.
  // Throws IoError, naming what differs, when the earlier run's fingerprint is another; when
  // something that the journal counts on is damaged or missing; when another run is at work there.
  static std::unique_ptr<RunRecord> open(const std::filesystem::path& folder,
                                         const std::string& fingerprint, Overwrite overwrite);
  // Removes the folder when nothing in it is worth going on with and the output holds nothing that
  // only this run accounts for.
  ~RunRecord();
  RunRecord(const RunRecord&) = delete;
  RunRecord& operator=(const RunRecord&) = delete;

  const std::filesystem::path& folder() const { return folder_; }
  // An earlier run is gone on with. One that was killed before its output was open had done nothing.
  bool resumes() const { return resumes_; }
  // From here on what stands in the output is this run's, which no other may take for its own.
  // REQUIRES: the output is open, and was empty unless this run resumes.
  void begin_output(const std::filesystem::path& output);

  bool is_surveyed(std::int32_t zoom) const { return surveyed_.contains(zoom); }
  // The coarsest zoom whose survey is on disk.
  std::optional<std::int32_t> coarsest_surveyed() const;
  // Zooms from here on have posts on disk: those of a survey, or of the sampling zoom that one was at;
  // beyond all zooms where there are none.
  std::int32_t coarsest_on_disk(std::int32_t sampling_zoom) const;
  // REQUIRES: is_surveyed(zoom). Throws IoError when the file is not what was written.
  SurveyedZoom surveyed(std::int32_t zoom, const TilingScheme& scheme) const;
  // REQUIRES: the zoom's lattice is on disk.
  void add_surveyed(std::int32_t zoom, const SurveyedZoom& surveyed);

  // `plan` names the tiles and their order. Throws IoError when an earlier run had another.
  void set_plan(const std::string& plan);
  const TileCheckpoint& tiles() const { return tiles_; }
  // REQUIRES: the tiles, and the borders that later ones need, are on disk.
  void add_tiles(const TileCheckpoint& checkpoint);

  // What is in the folder is worth nothing, unless an earlier run has left it.
  void discard() { is_discarded_ = !resumes_; }
  // True when another run would go on from here instead of starting again.
  bool is_worth_keeping() const;
  // The run in the folder, if there is one, has neither finished nor said that it is kept.
  static bool is_unfinished(const std::filesystem::path& folder);
  // Throws the IoError that says why this run cannot be gone on with.
  [[noreturn]] void refuse(const std::string& cause) const;
  // The output is whole: removes the folder, or keeps it for whoever wants to look into it.
  void finish(bool keep);

 private:
  RunRecord(std::filesystem::path folder, std::unique_ptr<Journal> journal);
  void read_lines(const std::string& fingerprint);
  bool read_line(const std::string& line);
  bool has_begun_output() const;
  void remove_folder();
  void check_stores() const;

  const std::filesystem::path folder_;
  std::unique_ptr<Journal> journal_;
  bool resumes_ = false;
  bool is_kept_ = false;
  bool is_discarded_ = false;
  bool is_output_ours_ = false;
  std::filesystem::path output_;  // once it is open
  // The number of lattice segments when the zoom was finished.
  std::map<std::int32_t, std::int32_t> surveyed_;
  std::optional<std::string> plan_;
  bool is_finished_ = false;
  bool is_clearing_ = false;  // says the last line
  TileCheckpoint tiles_;
};

// The path as it stands in its folder: absolute, without a slash at the end.
std::filesystem::path plain_path(const std::filesystem::path& path);

// OUT.qmpipe-run, beside the output however that is written ("tiles", "tiles/", ".").
std::filesystem::path run_folder_of(const std::filesystem::path& output);

}  // namespace qmpipe
