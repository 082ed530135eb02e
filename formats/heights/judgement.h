// Whether the values of a raster can be heights on Earth, and what to say where they cannot. For
// formats/ only.
//
// Guarantees: the options that a text names work when they are added to the command or put in place of the
// same ones. They are about values as the band stores them, since that is what gdalinfo shows.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "formats/heights/rule.h"
#include "formats/heights/value_counts.h"

namespace qmpipe {

// The Challenger Deep and Mount Everest, with room for a datum of any kind.
inline constexpr double kLowestOnEarthM = -11100;
inline constexpr double kHighestOnEarthM = 9000;

bool is_beyond_earth(const ValueCounts& counts, const HeightRule& rule);

// Of a raster's values, those beyond Earth and those on both sides of where they begin.
class OutsideCounts {
 public:
  explicit OutsideCounts(const HeightRule& rule);
  // NaN is a void.
  void add(std::span<const double> raws);
  // The outermost ones.
  void add(const ValueCounts& counts);

  struct End {
    std::int64_t count = 0;
    double nearest_outside = 0;   // where count > 0
    double outermost_inside = 0;  // NaN: there is nothing inside
  };
  const End& under() const { return under_; }
  const End& over() const { return over_; }

 private:
  double low_raw_;
  double high_raw_;
  End under_;
  End over_;
};

struct HeightRefusal {
  std::string cause;
  std::string remedy;
};

// REQUIRES: there are values beyond Earth. `given`: what the user has said already.
HeightRefusal refusal_of(const ValueCounts& counts, const OutsideCounts& outside,
                         const HeightRule& rule, const HeightOptions& given);

// Values that are no heights by all appearances: they stand far from all others, or are those which
// mostly mark voids and stand apart.
struct ApartValues {
  std::vector<CountedValue> values;
  // The others; NaN where there are none.
  double lowest_other = std::numeric_limits<double>::quiet_NaN();
  double highest_other = std::numeric_limits<double>::quiet_NaN();
};
ApartValues apart_values(const ValueCounts& counts, const HeightRule& rule);

// The value that a person would type for it: of a float the shortest.
double typed_value(double raw, const HeightRule& rule);
// Typed values as --void with what is given already: "--void -9999,-32768".
std::string void_option(const std::vector<double>& values, const HeightOptions& given);
// As the band stores it, and in metres where that is another number: "-32768 (-9987.69 m)".
std::string value_text(double raw, const HeightRule& rule);

}  // namespace qmpipe
