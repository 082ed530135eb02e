// How long something takes, by a clock that nobody sets.
#pragma once

#include <chrono>

namespace qmpipe {

class Stopwatch {
 public:
  // Since it was made, or since the last lap().
  double seconds() const { return std::chrono::duration<double>(Clock::now() - started_).count(); }
  // The same, and starts again.
  double lap() {
    const double passed_s = seconds();
    started_ = Clock::now();
    return passed_s;
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point started_ = Clock::now();
};

}  // namespace qmpipe
