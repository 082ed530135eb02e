// What a run says while it works: one block of lines on stderr when that is a terminal, JSON lines
// when asked for, nothing otherwise. Also the one place where a run learns that it should stop.
//
// Thread rule: counters and should_stop() are safe from any thread; begin() and end() are called by
// the thread that runs the phase.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "pipeline/stopwatch.h"

namespace qmpipe {

// Thrown by a pass that was asked to stop; tools/main.cpp turns it into exit code 130.
class Interrupted : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

enum class ProgressStyle { kSilent, kTerminal, kJsonLines };

// A named bounded buffer or stage, and how full it is now.
struct BufferFill {
  std::string name;
  std::int64_t filled = 0;
  std::int64_t capacity = 0;  // 0: has no bound of its own
};

class Progress {
 public:
  // `stop` may be null; else it is read, never written (a signal handler sets it).
  Progress(ProgressStyle style, const std::atomic<bool>* stop);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  // Starts a phase of `total` units ("posts", "tiles"); `fills` is called from the reporting thread.
  void begin(const std::string& phase, const std::string& unit, std::int64_t total,
             std::function<std::vector<BufferFill>()> fills = {});
  void advance(std::int64_t units) { done_.fetch_add(units, std::memory_order_relaxed); }
  void end();
  // A line for the user: on stderr, or as a JSON line {"event":"note"}.
  void note(const std::string& text);
  // A JSON line as it is; ignored in the other styles.
  void event(const std::string& json_object);

  bool should_stop() const { return stop_ != nullptr && stop_->load(std::memory_order_relaxed); }
  // Throws Interrupted when the run should stop.
  void check_stop() const;
  ProgressStyle style() const { return style_; }

 private:
  void report(bool final);
  void run();

  const ProgressStyle style_;
  const std::atomic<bool>* stop_;
  std::atomic<std::int64_t> done_ = 0;
  std::mutex mutex_;
  std::condition_variable wake_;
  bool active_ = false;
  bool quit_ = false;
  std::string phase_;
  std::string unit_;
  std::int64_t total_ = 0;
  std::function<std::vector<BufferFill>()> fills_;
  Stopwatch watch_;  // of the phase
  std::int32_t lines_shown_ = 0;
  std::thread thread_;
};

// A phase that ends when this goes out of scope, an exception included: `fills` may refer to what
// the phase's function owns.
class Phase {
 public:
  Phase(Progress& progress, const std::string& phase, const std::string& unit, std::int64_t total,
        std::function<std::vector<BufferFill>()> fills = {})
      : progress_(progress) {
    progress_.begin(phase, unit, total, std::move(fills));
  }
  ~Phase() { progress_.end(); }
  Phase(const Phase&) = delete;
  Phase& operator=(const Phase&) = delete;

 private:
  Progress& progress_;
};

}  // namespace qmpipe
