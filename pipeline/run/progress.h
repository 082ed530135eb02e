// What a run says while it works: one line on stderr when that is a terminal, JSON lines when asked for,
// nothing otherwise. Also the one place where a run learns that it should stop.
//
// On a terminal the line never breaks, however narrow the window is or becomes, and its time is that of
// the whole run, as far as the phases to come are known.
// Thread rule: counters and should_stop() are safe from any thread; all else is called by the thread
// that runs the phases.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "pipeline/common/stopwatch.h"
#include "pipeline/run/progress_line.h"
#include "pipeline/run/time_left.h"

namespace qmpipe {

// Thrown by a pass that was asked to stop; tools/main.cpp turns it into exit code 130.
class Interrupted : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

enum class ProgressStyle { kSilent, kTerminal, kJsonLines };

struct ProgressOptions {
  ProgressStyle style = ProgressStyle::kSilent;
  // May be null; else it is read, never written (a signal handler sets it).
  const std::atomic<bool>* stop = nullptr;
  // On a terminal; JSON lines always tell them. DEFAULT: no.
  bool shows_buffers = false;
  // Between two lines. DEFAULT: 0.5 s.
  std::chrono::milliseconds interval{500};
};

struct PhaseWork {
  std::string name;
  std::string unit;  // "posts", "tiles"
  std::int64_t total = 0;
  // Of them, what an earlier run has done.
  std::int64_t done_before = 0;
  // Called from the reporting thread.
  std::function<std::vector<BufferFill>()> fills = {};
};

class Progress {
 public:
  explicit Progress(const ProgressOptions& options);
  Progress(ProgressStyle style, const std::atomic<bool>* stop)
      : Progress(ProgressOptions{.style = style, .stop = stop}) {}
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  // The phases of the run, in their order (pipeline/run/time_left.h).
  void expect(std::vector<ExpectedPhase> phases);
  void correct(const ExpectedPhase& phase);

  void begin(PhaseWork work);
  void advance(std::int64_t units) { done_.fetch_add(units, std::memory_order_relaxed); }
  // Units that need no work, because an earlier run has done them.
  void skip(std::int64_t units) { skipped_.fetch_add(units, std::memory_order_relaxed); }
  void end();
  // A line for the user: on stderr, or as a JSON line {"event":"note"}.
  void note(const std::string& text);
  // A JSON line as it is; ignored in the other styles.
  void event(const std::string& json_object);

  bool should_stop() const {
    return options_.stop != nullptr && options_.stop->load(std::memory_order_relaxed);
  }
  // Throws Interrupted when the run should stop.
  void check_stop() const;
  ProgressStyle style() const { return options_.style; }

 private:
  void report(bool final);
  void run();
  void show(const PhaseState& state);
  void write_json(const PhaseState& state, double elapsed_s);

  const ProgressOptions options_;
  std::atomic<std::int64_t> done_ = 0;
  std::atomic<std::int64_t> skipped_ = 0;
  std::mutex mutex_;
  std::condition_variable wake_;
  bool active_ = false;
  bool quit_ = false;
  PhaseWork work_;
  TimeLeft time_left_;
  Stopwatch watch_;                 // of the phase
  std::int64_t shown_columns_ = 0;  // of the line that stands in the terminal
  std::thread thread_;
};

// A phase that ends when this goes out of scope, an exception included: what `work` calls may refer to
// what the phase's function owns.
class Phase {
 public:
  Phase(Progress& progress, PhaseWork work) : progress_(progress) {
    progress_.begin(std::move(work));
  }
  Phase(Progress& progress, const std::string& name, const std::string& unit, std::int64_t total)
      : Phase(progress, {.name = name, .unit = unit, .total = total}) {}
  ~Phase() { progress_.end(); }
  Phase(const Phase&) = delete;
  Phase& operator=(const Phase&) = delete;

 private:
  Progress& progress_;
};

}  // namespace qmpipe
