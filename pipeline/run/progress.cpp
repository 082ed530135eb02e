#include "pipeline/run/progress.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string_view>

#include "formats/bytes/printable.h"

namespace qmpipe {
namespace {

// A terminal shows ^C where the cursor is, which must not break the line either.
constexpr std::int64_t kColumnsLeftFree = 3;

// Past stdio, which may have been told to let no control sequence pass; what is not ours in `text` is
// printable already. Nobody could be told that it cannot be written.
void write_stderr(std::string_view text) {
  std::fflush(stderr);
  while (!text.empty()) {
    const ssize_t written = ::write(STDERR_FILENO, text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return;
    text.remove_prefix(static_cast<std::size_t>(written));
  }
}

// A path need not be UTF-8.
std::string line_of(const nlohmann::json& json) {
  return printable(json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)) + "\n";
}

}  // namespace

Progress::Progress(const ProgressOptions& options) : options_(options) {
  if (options_.style != ProgressStyle::kSilent) thread_ = std::thread([this] { run(); });
}

Progress::~Progress() {
  {
    const std::scoped_lock lock(mutex_);
    quit_ = true;
  }
  wake_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void Progress::expect(std::vector<ExpectedPhase> phases) {
  const std::scoped_lock lock(mutex_);
  time_left_.expect(std::move(phases));
}

void Progress::correct(const ExpectedPhase& phase) {
  const std::scoped_lock lock(mutex_);
  time_left_.correct(phase);
}

void Progress::begin(PhaseWork work) {
  const std::scoped_lock lock(mutex_);
  work_ = std::move(work);
  time_left_.begin(work_.name);
  done_.store(0);
  skipped_.store(work_.done_before);
  watch_ = Stopwatch();
  active_ = true;
}

void Progress::end() {
  const std::scoped_lock lock(mutex_);
  if (!active_) return;
  report(true);
  const std::int64_t skipped = skipped_.load(std::memory_order_relaxed);
  time_left_.end(time_left_.share_of(skipped, work_.total), watch_.seconds());
  active_ = false;
  work_ = {};
}

void Progress::note(const std::string& text) {
  const std::scoped_lock lock(mutex_);
  if (options_.style == ProgressStyle::kJsonLines) {
    write_stderr(line_of({{"event", "note"}, {"text", text}}));
    return;
  }
  const std::string erasing =
      shown_columns_ > 0 ? erasing_text(shown_columns_, window_columns()) : std::string();
  write_stderr(erasing + "qmpipe: " + printable_message(text) + "\n");
  shown_columns_ = 0;
}

void Progress::event(const std::string& json_object) {
  if (options_.style != ProgressStyle::kJsonLines) return;
  const std::scoped_lock lock(mutex_);
  write_stderr(printable(json_object) + "\n");
}

void Progress::check_stop() const {
  if (should_stop()) throw Interrupted("interrupted");
}

void Progress::run() {
  std::unique_lock lock(mutex_);
  while (!quit_) {
    wake_.wait_for(lock, options_.interval, [this] { return quit_; });
    if (active_ && !quit_) report(false);
  }
}

// REQUIRES: mutex_ is held.
void Progress::report(bool final) {
  const double elapsed_s = watch_.seconds();
  const std::int64_t worked = done_.load(std::memory_order_relaxed);
  const std::int64_t skipped = skipped_.load(std::memory_order_relaxed);
  PhaseState state = {.phase = work_.name,
                      .unit = work_.unit,
                      .done = worked + skipped,
                      .done_before = skipped,
                      .total = work_.total,
                      .rate_per_s = elapsed_s > 0 ? static_cast<double>(worked) / elapsed_s : 0};
  if (final) {
    state.took_s = elapsed_s;
  } else {
    state.left_s = time_left_.seconds(time_left_.share_of(state.done, state.total),
                                      time_left_.share_of(skipped, state.total), elapsed_s);
  }
  const bool is_json = options_.style == ProgressStyle::kJsonLines;
  if (work_.fills && (is_json || (options_.shows_buffers && !final))) state.fills = work_.fills();
  if (is_json) {
    write_json(state, elapsed_s);
  } else if (options_.style == ProgressStyle::kTerminal) {
    show(state);
  }
}

void Progress::write_json(const PhaseState& state, double elapsed_s) {
  const double units_left =
      static_cast<double>(std::max<std::int64_t>(0, state.total - state.done));
  nlohmann::json line = {{"event", state.took_s ? "phase_done" : "progress"},
                         {"phase", state.phase},
                         {"unit", state.unit},
                         {"done", state.done},
                         {"done_before", state.done_before},
                         {"total", state.total},
                         {"elapsed_s", elapsed_s},
                         {"rate_per_s", state.rate_per_s},
                         {"eta_s", state.rate_per_s > 0 ? units_left / state.rate_per_s : 0}};
  if (state.left_s) line["run_left_s"] = *state.left_s;
  for (const BufferFill& fill : state.fills) {
    line["buffers"][fill.name] = {{"filled", fill.filled}, {"capacity", fill.capacity}};
  }
  write_stderr(line_of(line));
}

// A phase that is over keeps its line.
void Progress::show(const PhaseState& state) {
  const std::int64_t window = window_columns();
  const std::string line =
      progress_line(state, std::max<std::int64_t>(1, window - kColumnsLeftFree));
  const bool stays = state.took_s.has_value();
  write_stderr(erasing_text(shown_columns_, window) + line + (stays ? "\n" : ""));
  shown_columns_ = stays ? 0 : columns_of(line);
}

}  // namespace qmpipe
