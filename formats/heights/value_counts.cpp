#include "formats/heights/value_counts.h"

#include <algorithm>
#include <cmath>

namespace qmpipe {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Into a list that is sorted by `before`, from the outermost value on, and holds a few.
template <class Before>
void insert(std::vector<CountedValue>& kept, const CountedValue& one, const Before& before) {
  const auto at = std::find_if(kept.begin(), kept.end(), [&](const CountedValue& other) {
    return !before(other.value, one.value);
  });
  if (at != kept.end() && at->value == one.value) {
    at->count += one.count;
    return;
  }
  if (at == kept.end() && kept.size() == ValueCounts::kKept) return;
  kept.insert(at, one);
  if (kept.size() > ValueCounts::kKept) kept.pop_back();
}

void insert_low(std::vector<CountedValue>& kept, const CountedValue& one) {
  insert(kept, one, [](double a, double b) { return a < b; });
}

void insert_high(std::vector<CountedValue>& kept, const CountedValue& one) {
  insert(kept, one, [](double a, double b) { return a > b; });
}

}  // namespace

double ValueCounts::lower_bound() const {
  const double full = lowest_.size() == kKept ? lowest_.back().value : kInfinity;
  return std::min(full, low_interest_);
}

double ValueCounts::upper_bound() const {
  const double full = highest_.size() == kKept ? highest_.back().value : -kInfinity;
  return std::max(full, high_interest_);
}

ValueCounts ValueCounts::begun() const {
  ValueCounts empty;
  empty.low_interest_ = lower_bound();
  empty.high_interest_ = upper_bound();
  return empty;
}

void ValueCounts::add(std::span<const double> values) {
  double low = kInfinity;
  double high = -kInfinity;
  std::int64_t valid = 0;
  // Most rows end here. Comparisons with NaN are false.
  for (const double value : values) {
    low = value < low ? value : low;
    high = value > high ? value : high;
    valid += std::isnan(value) ? 0 : 1;
  }
  count_ += valid;
  if (low <= lower_bound()) {
    for (const double value : values) {
      if (value <= lower_bound()) insert_low(lowest_, {.value = value, .count = 1});
    }
  }
  if (high >= upper_bound()) {
    for (const double value : values) {
      if (value >= upper_bound()) insert_high(highest_, {.value = value, .count = 1});
    }
  }
}

void ValueCounts::add(const ValueCounts& other) {
  count_ += other.count_;
  for (const CountedValue& one : other.lowest_) insert_low(lowest_, one);
  for (const CountedValue& one : other.highest_) insert_high(highest_, one);
}

}  // namespace qmpipe
