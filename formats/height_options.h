// What a user says about the heights of all inputs, where files do not say it or say it wrongly.
//
// Guarantees: the text forms are those of the command line and of layer.json; a text and what is read
// from it say the same.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "formats/result.h"

namespace qmpipe {

// What marks voids besides what a file declares: values as the band stores them, before scale, offset
// and unit.
struct VoidValues {
  std::vector<double> values;   // exactly these
  std::optional<double> below;  // and all that are less
  std::optional<double> above;  // and all that are more

  friend bool operator==(const VoidValues&, const VoidValues&) = default;
};

struct HeightOptions {
  // DEFAULT: what the file declares, alone.
  std::optional<VoidValues> voids;
  // A height is what the file says, in metres, times the one plus the other. DEFAULT: 1 and 0.
  std::optional<double> z_scale;
  std::optional<double> z_offset_m;

  bool is_default() const { return *this == HeightOptions(); }
  // What is not said here is taken from there.
  HeightOptions or_else(const HeightOptions& other) const;
  friend bool operator==(const HeightOptions&, const HeightOptions&) = default;
};

// What is no factor or no length on Earth; the option stands in the message.
std::optional<Error> fault_of(const HeightOptions& options);
// As on a command line: "--void -9999"; empty for the default.
std::string text_of(const HeightOptions& options);
// "-9999,<-12000,>9000"
std::string text_of(const VoidValues& voids);
Result<VoidValues> void_values_named(const std::string& text);

}  // namespace qmpipe
