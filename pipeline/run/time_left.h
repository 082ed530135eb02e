// How much longer a run of several phases takes: measured where a phase is at work, expected where it is
// still to come.
//
// Expectations need only be right in proportion: how a phase came out corrects what is expected of later
// ones of its name. Used by one thread at a time.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace qmpipe {

struct ExpectedPhase {
  std::string name;
  double seconds = 0;  // 0: as long as the last one of its name
  // What share of all its work the first `done` units are, 0 .. 1. DEFAULT: all take equally long.
  std::function<double(std::int64_t done)> share = {};
};

class TimeLeft {
 public:
  // The phases of the run in their order. A run inside another one brings its own list; the first one
  // counts.
  void expect(std::vector<ExpectedPhase> phases);
  // What is known now of the next phase of its name.
  void correct(const ExpectedPhase& phase);

  // Those that come before it in the list are over.
  void begin(const std::string& name);
  // Of the phase at work, when so many of its units are done.
  double share_of(std::int64_t done, std::int64_t total) const;
  // Of the phase at work: the share that is done, the share of it that was done when it began, and the
  // seconds since then. None while that says too little, or nothing is known of a phase to come.
  std::optional<double> seconds(double share, double share_before, double elapsed_s) const;
  // The phase is over, after those seconds.
  void end(double share_before, double elapsed_s);

 private:
  struct Experience {
    double expected_s = 0;
    double taken_s = 0;
  };
  std::optional<double> expected_s(const ExpectedPhase& phase) const;

  std::vector<ExpectedPhase> to_come_;
  bool has_list_ = false;
  ExpectedPhase at_work_;
  std::map<std::string, Experience> experience_;
};

}  // namespace qmpipe
