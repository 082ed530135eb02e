#include "tools/commands/synth.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>

#include <fmt/format.h>

#include "formats/bytes/errors.h"
#include "formats/raster/writer.h"
#include "stages/synth/synth_terrain.h"
#include "tools/arguments/help_format.h"
#include "tools/arguments/terminal.h"

namespace qmpipe {
namespace {

constexpr std::int64_t kLargestSide = 10'000'000;

struct GridExtent {
  std::int64_t width = 0;
  std::int64_t height = 0;
};

GridExtent parse_extent(const std::string& text) {
  GridExtent size;
  char rest = '\0';
  long long width = 0;
  long long height = 0;
  // A character after the numbers would be read into `rest`.
  if (std::sscanf(text.c_str(), "%lldx%lld%c", &width, &height, &rest) != 2 || width < 1 ||
      height < 1 || width > kLargestSide || height > kLargestSide) {
    throw UsageError("--size " + text +
                     " is not a size; write COLUMNSxROWS, for example 4096x2048, "
                     "each from 1 to 10000000");
  }
  size.width = width;
  size.height = height;
  return size;
}

RectangleDeg parse_bounds(const std::vector<double>& edges) {
  const RectangleDeg bounds{edges.at(0), edges.at(1), edges.at(2), edges.at(3)};
  const bool is_sound = bounds.west_deg >= -360 && bounds.east_deg <= 540 &&
                        bounds.west_deg < bounds.east_deg &&
                        bounds.east_deg - bounds.west_deg <= 360 && bounds.south_deg >= -90 &&
                        bounds.north_deg <= 90 && bounds.south_deg < bounds.north_deg;
  if (!is_sound) {
    throw UsageError(
        "--bounds must be WEST,SOUTH,EAST,NORTH in degrees with west < east at most 360 "
        "apart, -90 <= south < north <= 90; across the antimeridian let east exceed "
        "180, for example 170,-20,190,0");
  }
  return bounds;
}

void check_output(const SynthOptions& options) {
  if (options.output.empty()) throw UsageError("-o names the GeoTIFF to write");
  if (!options.overwrite && std::filesystem::exists(options.output)) {
    throw UsageError(options.output + " exists; choose another name or add --overwrite");
  }
}

// One line on a terminal that counts up; nothing elsewhere.
class ProgressLine {
 public:
  ProgressLine() : is_terminal_(stderr_is_terminal()) {}
  ~ProgressLine() {
    if (shown_ >= 0) std::fputc('\n', stderr);
  }
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  void show(std::int64_t done, std::int64_t all) {
    const std::int64_t percent = 100 * done / all;
    if (!is_terminal_ || percent == shown_) return;
    shown_ = percent;
    // Past stdio, which lets no control character pass.
    const std::string text = fmt::format("\rsynth {:3} %", percent);
    static_cast<void>(::write(STDERR_FILENO, text.data(), text.size()) < 0);
  }

 private:
  bool is_terminal_;
  std::int64_t shown_ = -1;
};

void write_terrain(RasterWriter& writer, SynthTerrain& terrain, const RasterWriterOptions& raster) {
  const RectangleDeg& b = raster.bounds_deg;
  const double dx = (b.east_deg - b.west_deg) / static_cast<double>(raster.width);
  const double dy = (b.north_deg - b.south_deg) / static_cast<double>(raster.height);
  const auto block = static_cast<std::int64_t>(raster.block_posts);
  std::vector<double> longitudes_deg;
  std::vector<std::int16_t> heights_m;
  ProgressLine progress;
  for (std::int64_t row0 = 0; row0 < raster.height; row0 += block) {
    for (std::int64_t column0 = 0; column0 < raster.width; column0 += block) {
      const PixelWindow window{.column0 = column0,
                               .row0 = row0,
                               .width = std::min(block, raster.width - column0),
                               .height = std::min(block, raster.height - row0)};
      const auto width = static_cast<std::size_t>(window.width);
      longitudes_deg.resize(width);
      for (std::size_t k = 0; k < width; ++k) {
        const auto column = static_cast<double>(column0) + static_cast<double>(k);
        longitudes_deg[k] = b.west_deg + (column + 0.5) * dx;
      }
      heights_m.resize(window.size());
      for (std::int64_t r = 0; r < window.height; ++r) {
        const double latitude_deg = b.north_deg - (static_cast<double>(row0 + r) + 0.5) * dy;
        terrain.sample_row(
            latitude_deg, longitudes_deg,
            std::span(heights_m).subspan(static_cast<std::size_t>(r) * width, width));
      }
      writer.write_block(window, heights_m);
    }
    progress.show(std::min(row0 + block, raster.height), raster.height);
  }
}

}  // namespace

int run_synth(const SynthOptions& options) {
  const GridExtent size = parse_extent(options.size);
  const RectangleDeg bounds = parse_bounds(options.bounds_deg);
  if (!(options.void_share >= 0 && options.void_share <= 1)) {
    throw UsageError("--voids must be a share from 0 to 1, for example 0.02");
  }
  check_output(options);
  const RasterWriterOptions raster{
      .width = size.width, .height = size.height, .bounds_deg = bounds};
  const double pixel_deg =
      std::min((bounds.east_deg - bounds.west_deg) / static_cast<double>(size.width),
               (bounds.north_deg - bounds.south_deg) / static_cast<double>(size.height));
  SynthTerrain terrain({.seed = options.seed,
                        .pixel_deg = pixel_deg,
                        .void_share = options.void_share,
                        .void_value = raster.void_value});
  const std::unique_ptr<RasterWriter> writer = RasterWriter::create(options.output, raster);
  write_terrain(*writer, terrain, raster);
  writer->close();
  return 0;
}

void register_synth(CLI::App& app, std::function<int()>& action) {
  const auto options = std::make_shared<SynthOptions>();
  CLI::App* const command =
      app.add_subcommand("synth", "Write a made-up DEM of any size (GeoTIFF, EPSG:4326, int16 m)");
  begin_group(*command, kOutputGroup);
  command->add_option("-o,--output", options->output, "GeoTIFF to write")->required();
  command->add_option("--size", options->size, "Columns x rows, in pixels")->capture_default_str();
  command
      ->add_option("--bounds", options->bounds_deg,
                   "WEST,SOUTH,EAST,NORTH: outer edges in degrees; east may exceed 180")
      ->delimiter(',')
      ->expected(4)
      ->capture_default_str();
  command->add_option("--seed", options->seed, "Another number, another planet")
      ->capture_default_str();
  command->add_option("--voids", options->void_share, "Share of posts in void holes, 0 to 1")
      ->capture_default_str();
  command->add_flag("--overwrite", options->overwrite, "Replace an existing file");
  command->footer(
      "The same options give the same heights on every machine. Example, an alpine square of 3\":\n"
      "  qmpipe synth -o dem.tif --size 3600x3600 --bounds 108,14,111,17 --voids 0.01");
  command->callback([options, &action] { action = [options] { return run_synth(*options); }; });
}

}  // namespace qmpipe
