// What a user says about the heights of all inputs, where files do not say it or say it wrongly.
//
// Guarantees: the text forms are those of the command line and of layer.json; a text and what is read
// from it say the same.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "formats/bytes/result.h"

namespace qmpipe {

// What marks voids besides what a file declares: values as the band stores them, before scale, offset
// and unit.
struct VoidValues {
  std::vector<double> values;   // exactly these
  std::optional<double> below;  // and all that are less
  std::optional<double> above;  // and all that are more

  friend bool operator==(const VoidValues&, const VoidValues&) = default;
};

// How three colours make a height: Mapbox's terrain-RGB, and Mapzen's terrarium.
enum class HeightEncoding { kTerrainRgb, kTerrarium };

struct HeightOptions {
  // DEFAULT: what the file declares, alone.
  std::optional<VoidValues> voids;
  // Whose numbers are the heights, from 1, whatever its colours mean. DEFAULT: the first; a picture is
  // refused.
  std::optional<std::int32_t> band;
  // Of pictures; other rasters are read as they are. DEFAULT: none.
  std::optional<HeightEncoding> encoding;
  // A height is what the file says, in metres, times the one plus the other. DEFAULT: 1 and 0.
  std::optional<double> z_scale;
  std::optional<double> z_offset_m;
  // NAME=VALUE, for the drivers that open the files, and for GDAL as a whole; of a recipe, names alone
  // that a run was given a value for and that is not told. DEFAULT: none.
  std::vector<std::string> open_options = {};
  std::vector<std::string> config = {};

  bool is_default() const { return *this == HeightOptions(); }
  // What is not said here is taken from there.
  HeightOptions or_else(const HeightOptions& other) const;
  friend bool operator==(const HeightOptions&, const HeightOptions&) = default;
};

// What makes no sense, alone or together; the option stands in the message.
std::optional<Error> fault_of(const HeightOptions& options);
// As on a command line: "--void -9999"; empty for the default.
std::string text_of(const HeightOptions& options);
// "-9999,<-12000,>9000"
std::string text_of(const VoidValues& voids);
Result<VoidValues> void_values_named(const std::string& text);
std::string name_of(HeightEncoding encoding);
Result<HeightEncoding> height_encoding_named(const std::string& name);

// Of a text NAME=VALUE, or NAME alone.
std::string option_name(const std::string& option);
bool has_option(const std::vector<std::string>& options, const std::string& name);
// By its name: what is worth keeping out of files and messages.
bool is_secret(const std::string& option);

}  // namespace qmpipe
