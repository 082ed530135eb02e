// The outermost values of a raster and how often each stands in it: what marks a void and is not
// declared stands out there.
//
// Guarantees: the counts of the values kept are exact, whatever the order and the pieces in which they
// were added.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace qmpipe {

struct CountedValue {
  double value = 0;
  std::int64_t count = 0;
  friend bool operator==(const CountedValue&, const CountedValue&) = default;
};

class ValueCounts {
 public:
  // Distinct values kept at each end.
  static constexpr std::size_t kKept = 6;

  // NaN is a void and not counted.
  void add(std::span<const double> values);
  void add(const ValueCounts& other);

  // Of all values that are no void.
  std::int64_t count() const { return count_; }
  // From the lowest on, and from the highest on.
  const std::vector<CountedValue>& lowest() const { return lowest_; }
  const std::vector<CountedValue>& highest() const { return highest_; }
  // Nothing between the two can change this any more.
  double lower_bound() const;
  double upper_bound() const;
  // Empty, for values that are to be added to this: what could not change this is counted, but not
  // looked at.
  ValueCounts begun() const;

 private:
  std::int64_t count_ = 0;
  std::vector<CountedValue> lowest_;
  std::vector<CountedValue> highest_;
  // Values above the one and below the other need not be kept.
  double low_interest_ = std::numeric_limits<double>::infinity();
  double high_interest_ = -std::numeric_limits<double>::infinity();
};

}  // namespace qmpipe
