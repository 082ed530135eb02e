#include "pipeline/run/time_left.h"

#include <algorithm>
#include <utility>

namespace qmpipe {
namespace {

// The share of a phase after which what was measured counts as much as what was expected.
constexpr double kHalfTrust = 0.05;

}  // namespace

void TimeLeft::expect(std::vector<ExpectedPhase> phases) {
  if (has_list_) return;
  has_list_ = true;
  to_come_ = std::move(phases);
}

void TimeLeft::correct(const ExpectedPhase& phase) {
  const auto next =
      std::find_if(to_come_.begin(), to_come_.end(),
                   [&phase](const ExpectedPhase& other) { return other.name == phase.name; });
  if (next == to_come_.end()) return;
  // What came before says nothing about the new number.
  experience_.erase(phase.name);
  const double before_s = next->seconds;
  *next = phase;
  if (before_s <= 0) return;
  for (auto later = next + 1; later != to_come_.end(); ++later) {
    if (later->name == phase.name) later->seconds *= phase.seconds / before_s;
  }
}

void TimeLeft::begin(const std::string& name) {
  const auto own = std::find_if(to_come_.begin(), to_come_.end(),
                                [&name](const ExpectedPhase& phase) { return phase.name == name; });
  at_work_ = {.name = name};
  if (own == to_come_.end()) return;
  at_work_ = *own;
  to_come_.erase(to_come_.begin(), own + 1);
}

double TimeLeft::share_of(std::int64_t done, std::int64_t total) const {
  if (at_work_.share) return at_work_.share(done);
  return total > 0 ? static_cast<double>(done) / static_cast<double>(total) : 1;
}

std::optional<double> TimeLeft::expected_s(const ExpectedPhase& phase) const {
  const auto it = experience_.find(phase.name);
  const bool is_known = it != experience_.end();
  if (phase.seconds <= 0) return is_known ? std::optional(it->second.taken_s) : std::nullopt;
  const bool corrects = is_known && it->second.expected_s > 0;
  return corrects ? phase.seconds * it->second.taken_s / it->second.expected_s : phase.seconds;
}

std::optional<double> TimeLeft::seconds(double share, double share_before, double elapsed_s) const {
  const std::optional<double> expected = expected_s(at_work_);
  const double done = share - share_before;
  if (done <= 0 && !expected) return std::nullopt;
  double whole_s = expected.value_or(0);
  if (done > 0) {
    const double trust = expected ? done / (done + kHalfTrust) : 1;
    whole_s = trust * elapsed_s / done + (1 - trust) * whole_s;
  }
  double left_s = std::max(0.0, 1 - share) * whole_s;
  if (done <= 0) left_s = std::max(0.0, left_s - elapsed_s);
  for (const ExpectedPhase& phase : to_come_) {
    const std::optional<double> later_s = expected_s(phase);
    if (!later_s) return std::nullopt;
    left_s += *later_s;
  }
  return left_s;
}

void TimeLeft::end(double share_before, double elapsed_s) {
  if (share_before >= 1) return;
  experience_[at_work_.name] = {.expected_s = at_work_.seconds,
                                .taken_s = elapsed_s / (1 - share_before)};
}

}  // namespace qmpipe
