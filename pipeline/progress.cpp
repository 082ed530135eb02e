#include "pipeline/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string_view>

#include "formats/printable.h"

namespace qmpipe {
namespace {

constexpr auto kInterval = std::chrono::milliseconds(500);

std::string duration_text(double seconds) {
  const std::int64_t s = std::llround(seconds);
  if (s >= 3600) return fmt::format("{} h {:02} min", s / 3600, s % 3600 / 60);
  if (s >= 60) return fmt::format("{} min {:02} s", s / 60, s % 60);
  return fmt::format("{} s", s);
}

std::string fill_text(const BufferFill& fill) {
  return fill.capacity > 0 ? fmt::format("{} {}/{}", fill.name, fill.filled, fill.capacity)
                           : fmt::format("{} {}", fill.name, fill.filled);
}

constexpr const char* kClearLine = "\r\033[K";

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

Progress::Progress(ProgressStyle style, const std::atomic<bool>* stop)
    : style_(style), stop_(stop) {
  if (style_ != ProgressStyle::kSilent) thread_ = std::thread([this] { run(); });
}

Progress::~Progress() {
  {
    const std::scoped_lock lock(mutex_);
    quit_ = true;
  }
  wake_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void Progress::begin(const std::string& phase, const std::string& unit, std::int64_t total,
                     std::function<std::vector<BufferFill>()> fills) {
  const std::scoped_lock lock(mutex_);
  phase_ = phase;
  unit_ = unit;
  total_ = total;
  fills_ = std::move(fills);
  done_.store(0);
  watch_ = Stopwatch();
  active_ = true;
}

void Progress::end() {
  const std::scoped_lock lock(mutex_);
  if (!active_) return;
  report(true);
  active_ = false;
  fills_ = {};
}

void Progress::note(const std::string& text) {
  const std::scoped_lock lock(mutex_);
  if (style_ == ProgressStyle::kJsonLines) {
    write_stderr(line_of({{"event", "note"}, {"text", text}}));
  } else {
    write_stderr((lines_shown_ > 0 ? kClearLine : "") +
                 ("qmpipe: " + printable_message(text) + "\n"));
    lines_shown_ = 0;
  }
}

void Progress::event(const std::string& json_object) {
  if (style_ != ProgressStyle::kJsonLines) return;
  const std::scoped_lock lock(mutex_);
  write_stderr(printable(json_object) + "\n");
}

void Progress::check_stop() const {
  if (should_stop()) throw Interrupted("interrupted");
}

void Progress::run() {
  std::unique_lock lock(mutex_);
  while (!quit_) {
    wake_.wait_for(lock, kInterval, [this] { return quit_; });
    if (active_ && !quit_) report(false);
  }
}

// REQUIRES: mutex_ is held.
void Progress::report(bool final) {
  const double elapsed_s = watch_.seconds();
  const std::int64_t done = done_.load(std::memory_order_relaxed);
  const double rate = elapsed_s > 0 ? static_cast<double>(done) / elapsed_s : 0;
  const double left_s =
      rate > 0 ? static_cast<double>(std::max<std::int64_t>(0, total_ - done)) / rate : 0;
  const std::vector<BufferFill> fills = fills_ ? fills_() : std::vector<BufferFill>{};
  if (style_ == ProgressStyle::kJsonLines) {
    nlohmann::json line = {{"event", final ? "phase_done" : "progress"},
                           {"phase", phase_},
                           {"unit", unit_},
                           {"done", done},
                           {"total", total_},
                           {"elapsed_s", elapsed_s},
                           {"rate_per_s", rate},
                           {"eta_s", left_s}};
    for (const BufferFill& fill : fills) {
      line["buffers"][fill.name] = {{"filled", fill.filled}, {"capacity", fill.capacity}};
    }
    write_stderr(line_of(line));
    return;
  }
  if (style_ != ProgressStyle::kTerminal) return;
  std::string text = fmt::format(
      "\r\033[K{}: {}/{} {} ({:.0f} %), {:.0f}/s", phase_, done, total_, unit_,
      total_ > 0 ? 100.0 * static_cast<double>(done) / static_cast<double>(total_) : 100.0, rate);
  if (final) {
    text += ", took " + duration_text(elapsed_s) + "\n";
  } else {
    text += ", " + duration_text(left_s) + " left";
    for (const BufferFill& fill : fills) text += " | " + fill_text(fill);
  }
  lines_shown_ = final ? 0 : 1;
  write_stderr(text);
}

}  // namespace qmpipe
