// What a phase looks like in one line of a terminal, and what must be sent to replace that line.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace qmpipe {

// A named bounded buffer or stage, and how full it is now.
struct BufferFill {
  std::string name;
  std::int64_t filled = 0;
  std::int64_t capacity = 0;  // 0: has no bound of its own
};

struct PhaseState {
  std::string phase;
  std::string unit;
  std::int64_t done = 0;
  std::int64_t done_before = 0;  // of them, what needed no work
  std::int64_t total = 0;
  double rate_per_s = 0;
  std::optional<double> left_s = {};   // of the whole run
  std::optional<double> took_s = {};   // of the phase, once it is over
  std::vector<BufferFill> fills = {};  // those to be shown
};

// "mesh: 1,234/5,678 tiles (22 %), 310/s, 14 s left", and as much less as fits: buffers go first, then
// the rate, the numbers, the time, the name. Never wider than `columns`. REQUIRES: columns >= 0.
std::string progress_line(const PhaseState& state, std::int64_t columns);

// "3 s", "2 min 05 s", "1 h 02 min"
std::string duration_text(double seconds);

// How wide the window behind stderr is now: what the terminal says, else COLUMNS, else 80.
std::int64_t window_columns();

// Takes away a line of `shown` columns at whose end the cursor stands, though the window may have become
// narrower meanwhile and have broken the line.
std::string erasing_text(std::int64_t shown, std::int64_t window);

}  // namespace qmpipe
