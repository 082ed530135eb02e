#include "tools/arguments/heights.h"

#include <CLI/CLI.hpp>

#include "formats/sources/raster_source.h"
#include "tools/arguments/parse_values.h"

namespace qmpipe {
namespace {

void add_gdal_options(CLI::App& command, HeightArguments& arguments) {
  command
      .add_option(
          "--oo", arguments.open_options,
          "An open option of GDAL's driver (MODE=RESAMPLED_GRID: a BAG's fine grid); once for "
          "each")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
  command
      .add_option(
          "--config", arguments.config,
          "A configuration option of GDAL (GDAL_NETCDF_BOTTOMUP=NO); once for each. Secrets are "
          "better set in the environment")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
}

void require_pairs(const char* flag, const std::vector<std::string>& options) {
  for (const std::string& option : options) {
    const std::size_t equals = option.find('=');
    if (equals != std::string::npos && equals > 0) continue;
    throw UsageError(std::string(flag) + " " + option + ": give NAME=VALUE");
  }
}

}  // namespace

void add_height_options(CLI::App& command, HeightArguments& arguments) {
  command
      .add_option(
          "--void", arguments.voids,
          "Values that mark voids besides the declared one, as the band stores them, between "
          "commas; <X and >Y: all below X, above Y (-9999,-32768 or \"<-12000,>9000\")")
      ->type_name("VALUES");
  command
      .add_option("--band", arguments.band,
                  "Take the numbers of this band for heights, whatever they are (default: the "
                  "first; pictures are refused)")
      ->type_name("N");
  command
      .add_option("--encoding", arguments.encoding,
                  "How the colours of pictures encode heights: terrain-rgb or terrarium")
      ->check(CLI::IsMember({"terrain-rgb", "terrarium"}));
  add_gdal_options(command, arguments);
  command
      .add_option(
          "--z-scale", arguments.z_scale,
          "Multiply heights, which are metres by then, after what the file says of scale, unit "
          "and direction (0.3048: they were feet; -1: the other way up; default: 1)")
      ->type_name("F");
  command
      .add_option("--z-offset", arguments.z_offset_m,
                  "Add metres to all heights, after --z-scale (default: 0)")
      ->type_name("M");
}

void add_height_guard(CLI::App& command, HeightArguments& arguments) {
  command.add_flag(
      "--allow-heights", arguments.allow_heights,
      "Take heights below -11100 m or above 9000 m, which end the run else: nothing on "
      "Earth is there, so they are voids or in another unit");
}

HeightOptions to_height_options(const HeightArguments& arguments) {
  HeightOptions options;
  if (!arguments.voids.empty()) {
    options.voids = understood("--void", void_values_named(arguments.voids));
  }
  options.band = arguments.band;
  if (!arguments.encoding.empty()) {
    options.encoding = understood("--encoding", height_encoding_named(arguments.encoding));
  }
  require_pairs("--oo", arguments.open_options);
  require_pairs("--config", arguments.config);
  options.open_options = arguments.open_options;
  options.config = arguments.config;
  for (const std::string& option : options.config) {
    set_gdal_config(option_name(option), option.substr(option.find('=') + 1));
  }
  options.z_scale = arguments.z_scale;
  options.z_offset_m = arguments.z_offset_m;
  if (const auto fault = fault_of(options)) throw UsageError(fault->message);
  return options;
}

std::string heights_text(const HeightOptions& options) {
  return options.is_default() ? "(what the files say)" : text_of(options);
}

HeightGuard to_height_guard(const HeightArguments& arguments) {
  return arguments.allow_heights ? HeightGuard::kAllow : HeightGuard::kStop;
}

}  // namespace qmpipe
