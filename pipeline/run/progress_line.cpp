#include "pipeline/run/progress_line.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <string_view>

#include "formats/bytes/printable.h"
#include "pipeline/common/text_table.h"

namespace qmpipe {
namespace {

constexpr std::int64_t kUsualColumns = 80;
// Beyond it a line would be no easier to read.
constexpr std::int64_t kMostColumns = 1000;

std::string fill_text(const BufferFill& fill) {
  return fill.capacity > 0 ? fmt::format("{} {}/{}", fill.name, fill.filled, fill.capacity)
                           : fmt::format("{} {}", fill.name, fill.filled);
}

// Of what has a total; rounded down, so that 100 % is all of it.
std::string percent_text(const PhaseState& state) {
  const double share =
      state.total > 0 ? static_cast<double>(state.done) / static_cast<double>(state.total) : 1;
  return fmt::format("{:.0f} %", std::floor(100 * share));
}

std::string time_text(const PhaseState& state) {
  if (state.took_s) return ", took " + duration_text(*state.took_s);
  return state.left_s ? ", " + duration_text(*state.left_s) + " left" : "";
}

}  // namespace

std::string duration_text(double seconds) {
  const std::int64_t s = std::llround(seconds);
  if (s >= 3600) return fmt::format("{} h {:02} min", s / 3600, s % 3600 / 60);
  if (s >= 60) return fmt::format("{} min {:02} s", s / 60, s % 60);
  return fmt::format("{} s", s);
}

std::string progress_line(const PhaseState& state, std::int64_t columns) {
  const std::string percent = percent_text(state);
  const std::string numbers = fmt::format("{}: {}/{} {} ({})", state.phase, grouped(state.done),
                                          grouped(state.total), state.unit, percent);
  const std::string rate =
      fmt::format(", {}/s", grouped(static_cast<std::int64_t>(std::llround(state.rate_per_s))));
  const std::string time = time_text(state);
  std::string line = numbers + rate + time;
  if (columns_of(line) <= columns) {
    for (const BufferFill& fill : state.fills) {
      const std::string more = line + " | " + fill_text(fill);
      if (columns_of(more) > columns) break;
      line = more;
    }
    return line;
  }
  for (const std::string& shorter :
       {numbers + time, fmt::format("{}: {}{}", state.phase, percent, time),
        fmt::format("{} {}", state.phase, percent), percent}) {
    if (columns_of(shorter) <= columns) return shorter;
  }
  return cut_to_columns(percent, columns);
}

std::int64_t window_columns() {
  winsize size{};
  if (::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0) return size.ws_col;
  std::int64_t columns = 0;
  const char* text = std::getenv("COLUMNS");
  const std::string_view view = text == nullptr ? "" : text;
  const auto [end, code] = std::from_chars(view.data(), view.data() + view.size(), columns);
  const bool is_number = code == std::errc() && end == view.data() + view.size();
  return is_number && columns > 0 ? std::min(columns, kMostColumns) : kUsualColumns;
}

std::string erasing_text(std::int64_t shown, std::int64_t window) {
  std::string text = "\r\033[K";
  // Terminals break a line that no longer fits, and the cursor goes with its end. Row by row, for what is
  // cleared as a whole goes into tmux's history.
  for (std::int64_t rest = shown - window; rest > 0; rest -= window) text += "\033[A\033[K";
  return text;
}

}  // namespace qmpipe
