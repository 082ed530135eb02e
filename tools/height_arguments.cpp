#include "tools/height_arguments.h"

#include <CLI/CLI.hpp>

#include "tools/parse_values.h"

namespace qmpipe {

void add_height_options(CLI::App& command, HeightArguments& arguments) {
  command
      .add_option(
          "--void", arguments.voids,
          "Values that mark voids besides the declared one, as the band stores them, between "
          "commas; <X and >Y: all below X, above Y (-9999,-32768 or \"<-12000,>9000\")")
      ->type_name("VALUES");
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
