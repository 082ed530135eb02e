#include "formats/heights/judgement.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <utility>

#include "scheduler/check.h"

namespace qmpipe {
namespace {

// Where values mark voids, these do mostly; in the file's unit or in metres.
constexpr std::array<double, 12> kUsualVoids = {-99,    -999,   -9999, -99999, -999999, -10000,
                                                -32768, -32767, 32767, 65535,  9999,    99999};
// Of those, a gap to the others of so much of itself.
constexpr double kUsualGapShare = 0.05;
// Of any other value, a gap of more than the others' range, and of so much.
constexpr double kLargeGapM = 500;
// Values that go on beyond Earth's without a gap are heights in another unit.
constexpr double kSmallGapShare = 0.05;

double raw_at(double height_m, const HeightRule& rule) {
  return ((height_m - rule.z_offset_m) / (rule.metres_per_unit * rule.direction * rule.z_scale) -
          rule.offset) /
         rule.scale;
}

double metres_per_raw(const HeightRule& rule) {
  return std::abs(rule.scale * rule.metres_per_unit * rule.z_scale);
}

bool is_usual_void(double raw, const HeightRule& rule) {
  // Off by one where somebody has rounded or counted from the other end.
  const auto is_near = [](double value) {
    return std::any_of(kUsualVoids.begin(), kUsualVoids.end(),
                       [value](double usual) { return std::abs(value - usual) <= 1; });
  };
  return is_near(raw) || is_near(raw * rule.scale + rule.offset) || is_near(rule.height_m(raw));
}

double number_in(const std::string& text) {
  double value = 0;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

std::string raw_text(double raw, const HeightRule& rule) {
  return rule.is_float ? fmt::format("{}", static_cast<float>(raw)) : fmt::format("{}", raw);
}

VoidValues with_given(VoidValues voids, const HeightOptions& given) {
  if (!given.voids) return voids;
  VoidValues both = *given.voids;
  both.values.insert(both.values.end(), voids.values.begin(), voids.values.end());
  if (voids.below) both.below = both.below ? std::max(*voids.below, *both.below) : *voids.below;
  if (voids.above) both.above = both.above ? std::min(*voids.above, *both.above) : *voids.above;
  return both;
}

std::string option_of(const VoidValues& voids) {
  // For the shell.
  const char* const quote = voids.below || voids.above ? "\"" : "";
  return fmt::format("--void {0}{1}{0}", quote, text_of(voids));
}

// The value with the fewest digits between two, so that a bound can be read and typed.
double roundest_between(double low, double high) {
  const double middle = low + (high - low) / 2;
  for (int digits = 0; digits < 17; ++digits) {
    const double round = number_in(fmt::format("{:.{}e}", middle, digits));
    if (round > low && round < high) return round;
  }
  return middle;
}

// One end's values beyond Earth.
struct OutsideEnd {
  const OutsideCounts::End& end;
  const std::vector<CountedValue>& outermost;
  bool is_low = false;  // in raw values
  const HeightRule& rule;

  // All of them, where they are few.
  std::vector<double> few() const {
    constexpr std::size_t kFew = 3;
    std::vector<double> values;
    std::int64_t left = end.count;
    for (const CountedValue& one : outermost) {
      if (left <= 0 || values.size() == kFew) break;
      values.push_back(one.value);
      left -= one.count;
    }
    return left == 0 ? values : std::vector<double>();
  }

  // As heights in another unit do.
  bool goes_on_from_inside() const {
    if (!few().empty()) return false;
    const double reach = std::abs(outermost.front().value - end.nearest_outside);
    const double gap = std::abs(end.nearest_outside - end.outermost_inside);
    return std::isnan(gap) || gap <= kSmallGapShare * reach;
  }

  void add_to(VoidValues& voids) const {
    const std::vector<double> values = few();
    for (const double value : values) voids.values.push_back(typed_value(value, rule));
    if (!values.empty()) return;
    const double inside = std::isnan(end.outermost_inside) ? 0 : end.outermost_inside;
    const double bound = is_low ? roundest_between(end.nearest_outside, inside)
                                : roundest_between(inside, end.nearest_outside);
    (is_low ? voids.below : voids.above) = bound;
  }

  std::string text(std::int64_t of) const {
    const bool is_deep = rule.height_m(outermost.front().value) < 0;
    const std::vector<double> values = few();
    std::string what = fmt::format("{} to {}", is_deep ? "go down" : "go up",
                                   value_text(outermost.front().value, rule));
    for (std::size_t k = 0; k < values.size(); ++k) {
      if (k == 0) what = "hold ";
      if (k > 0) what += " or ";
      what += value_text(values[k], rule);
    }
    return fmt::format("{} of {} pixels {}, and nothing on Earth is {} than {} m", end.count, of,
                       what, is_deep ? "lower" : "higher",
                       is_deep ? kLowestOnEarthM : kHighestOnEarthM);
  }
};

struct UnitGuess {
  const char* name;
  double metres;
};

// One that brings all heights to Earth.
std::optional<UnitGuess> unit_that_fits(const ValueCounts& counts, const HeightRule& rule) {
  static constexpr std::array<UnitGuess, 4> kUnits = {
      {{"feet", 0.3048}, {"decimetres", 0.1}, {"centimetres", 0.01}, {"millimetres", 0.001}}};
  const auto [low_m, high_m] = std::minmax({rule.height_m(counts.lowest().front().value),
                                            rule.height_m(counts.highest().front().value)});
  for (const UnitGuess& unit : kUnits) {
    if (low_m * unit.metres >= kLowestOnEarthM && high_m * unit.metres <= kHighestOnEarthM) {
      return unit;
    }
  }
  return std::nullopt;
}

bool is_apart(std::span<const CountedValue> group, double next, double other_end,
              const HeightRule& rule) {
  const double gap = std::abs(group.back().value - next);
  const double gap_m = gap * metres_per_raw(rule);
  const double others_m = std::abs(other_end - next) * metres_per_raw(rule);
  if (gap_m > kLargeGapM && gap_m > others_m) return true;
  return std::all_of(group.begin(), group.end(), [&](const CountedValue& one) {
    return is_usual_void(one.value, rule) && gap >= kUsualGapShare * std::abs(one.value);
  });
}

// How many of the outermost values stand apart, the others reaching to `other_end`.
std::size_t count_apart(std::span<const CountedValue> outermost, double other_end,
                        const HeightRule& rule) {
  std::size_t apart = 0;
  for (std::size_t k = 1; k < outermost.size(); ++k) {
    if (outermost[k - 1].value == other_end) break;
    if (is_apart(outermost.first(k), outermost[k].value, other_end, rule)) apart = k;
  }
  return apart;
}

}  // namespace

std::string value_text(double raw, const HeightRule& rule) {
  const double height_m = rule.height_m(raw);
  const std::string text = raw_text(raw, rule);
  return height_m == raw ? text : fmt::format("{} ({:g} m)", text, height_m);
}

double typed_value(double raw, const HeightRule& rule) { return number_in(raw_text(raw, rule)); }

std::string void_option(const std::vector<double>& values, const HeightOptions& given) {
  return option_of(
      with_given({.values = values, .below = std::nullopt, .above = std::nullopt}, given));
}

bool is_beyond_earth(const ValueCounts& counts, const HeightRule& rule) {
  const auto is_outside = [&rule](const std::vector<CountedValue>& outermost) {
    if (outermost.empty()) return false;
    const double height_m = rule.height_m(outermost.front().value);
    return height_m < kLowestOnEarthM || height_m > kHighestOnEarthM;
  };
  return is_outside(counts.lowest()) || is_outside(counts.highest());
}

OutsideCounts::OutsideCounts(const HeightRule& rule)
    : low_raw_(raw_at(kLowestOnEarthM, rule)), high_raw_(raw_at(kHighestOnEarthM, rule)) {
  if (low_raw_ > high_raw_) std::swap(low_raw_, high_raw_);
  constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();
  under_.outermost_inside = kNothing;
  over_.outermost_inside = kNothing;
}

void OutsideCounts::add(std::span<const double> raws) {
  for (const double raw : raws) {
    if (raw < low_raw_) {
      under_.nearest_outside = under_.count == 0 ? raw : std::max(under_.nearest_outside, raw);
      ++under_.count;
    } else if (raw > high_raw_) {
      over_.nearest_outside = over_.count == 0 ? raw : std::min(over_.nearest_outside, raw);
      ++over_.count;
    } else if (!std::isnan(raw)) {
      // Of NaN and another, the other.
      under_.outermost_inside = std::fmin(under_.outermost_inside, raw);
      over_.outermost_inside = std::fmax(over_.outermost_inside, raw);
    }
  }
}

void OutsideCounts::add(const ValueCounts& counts) {
  for (const auto* kept : {&counts.lowest(), &counts.highest()}) {
    for (const CountedValue& one : *kept) {
      const std::array<double, 1> value = {one.value};
      for (std::int64_t k = 0; k < one.count; ++k) add(value);
    }
  }
}

ApartValues apart_values(const ValueCounts& counts, const HeightRule& rule) {
  std::span<const CountedValue> low = counts.lowest();
  std::span<const CountedValue> high = counts.highest();
  ApartValues apart;
  if (low.empty()) return apart;
  if (low.front().value == high.front().value) {
    if (is_usual_void(low.front().value, rule)) apart.values = {low.front()};
    return apart;
  }
  // One end's show what the range of the others is, and so may the other's.
  for (int round = 0; round < 2; ++round) {
    const std::size_t under = count_apart(low, high.front().value, rule);
    apart.values.insert(apart.values.end(), low.begin(),
                        low.begin() + static_cast<std::ptrdiff_t>(under));
    low = low.subspan(under);
    const std::size_t over = count_apart(high, low.front().value, rule);
    apart.values.insert(apart.values.end(), high.begin(),
                        high.begin() + static_cast<std::ptrdiff_t>(over));
    high = high.subspan(over);
  }
  apart.lowest_other = low.front().value;
  apart.highest_other = high.front().value;
  return apart;
}

HeightRefusal refusal_of(const ValueCounts& counts, const OutsideCounts& outside,
                         const HeightRule& rule, const HeightOptions& given) {
  QMPIPE_CHECK(counts.count() > 0);
  const std::array<OutsideEnd, 2> ends = {
      OutsideEnd{outside.under(), counts.lowest(), true, rule},
      OutsideEnd{outside.over(), counts.highest(), false, rule}};
  HeightRefusal refusal;
  VoidValues voids;
  bool goes_on = false;
  for (const OutsideEnd& end : ends) {
    if (end.end.count == 0) continue;
    refusal.cause += (refusal.cause.empty() ? "" : "; ") + end.text(counts.count());
    end.add_to(voids);
    goes_on = goes_on || end.goes_on_from_inside();
  }
  // One option for all.
  for (const CountedValue& one : apart_values(counts, rule).values) {
    const double height_m = rule.height_m(one.value);
    if (height_m < kLowestOnEarthM || height_m > kHighestOnEarthM) continue;
    refusal.cause += fmt::format("; {} stands apart from the rest in {}",
                                 value_text(one.value, rule), one.count);
    voids.values.push_back(typed_value(one.value, rule));
  }
  if (const auto unit = unit_that_fits(counts, rule); unit && goes_on) {
    refusal.remedy =
        fmt::format("if its heights are {}: --z-scale {:g}; ", unit->name, unit->metres);
  }
  refusal.remedy +=
      fmt::format("if these values mark voids: {}; if they are meant: --allow-heights",
                  option_of(with_given(voids, given)));
  return refusal;
}

}  // namespace qmpipe
