#include "pipeline/recipe/build_options.h"

#include <fmt/format.h>

#include <cmath>

#include "formats/tile_sets/tile_output.h"

namespace qmpipe {
namespace {

// Below this the heights of float32 lattices and headers are coarser than the tolerance. What the
// default comes to at the deepest zoom, 0.9 mm, is above it.
constexpr double kSmallestToleranceM = 0.0005;
constexpr double kLargestToleranceM = 1e7;
constexpr std::int32_t kMostThreads = 1024;

bool is_tolerance(double tolerance_m) {
  return std::isfinite(tolerance_m) && tolerance_m >= kSmallestToleranceM &&
         tolerance_m <= kLargestToleranceM;
}

}  // namespace

std::vector<std::string> violated_rules(const BuildOptions& options) {
  std::vector<std::string> rules;
  const auto require = [&rules](bool holds, std::string rule) {
    if (!holds) rules.push_back(std::move(rule));
  };
  const MeshOptions& mesh = options.mesh;
  require(!options.input.paths.empty(), "INPUT: name at least one raster");
  require(options.run.dry_run || !options.output.path.empty(),
          "-o, --output: name the folder or the .mbtiles file for the tiles");
  require(form_of(options.output.path) != TileForm::kPmtiles,
          fmt::format("-o, --output {}: no build keeps the order of tiles that a PMTiles file has; "
                      "build an .mbtiles file, then: qmpipe convert OUT.mbtiles -o OUT.pmtiles",
                      options.output.path.string()));
  require(mesh.min_zoom >= 0 && mesh.min_zoom <= kMaxZoom,
          fmt::format("--min-zoom must be 0..{}", kMaxZoom));
  require(!mesh.max_zoom || (*mesh.max_zoom >= 0 && *mesh.max_zoom <= kMaxZoom),
          fmt::format("--max-zoom must be 0..{}", kMaxZoom));
  require(mesh.max_zoom.value_or(-1) < 0 || *mesh.max_zoom >= mesh.min_zoom,
          fmt::format("--min-zoom {} is deeper than --max-zoom {}; give --min-zoom {} or less",
                      mesh.min_zoom, mesh.max_zoom.value_or(0), mesh.max_zoom.value_or(0)));
  for (const auto& [zoom, tolerance_m] : mesh.tolerance_at_m) {
    require(zoom >= 0 && zoom <= kMaxZoom && is_tolerance(tolerance_m),
            fmt::format("--tolerance-at {}={}: the zoom must be 0..{}, the tolerance {}..{} metres",
                        zoom, tolerance_m, kMaxZoom, kSmallestToleranceM, kLargestToleranceM));
  }
  require(mesh.method == Method::kEdgeCollapse || mesh.stop == Stop::kTolerance,
          "--stop edges is for --method edge-collapse only");
  require(!options.encode.gzip_level ||
              (*options.encode.gzip_level >= 1 && *options.encode.gzip_level <= 12),
          "--gzip must be 1..12 or none");
  require(options.run.threads >= 1 && options.run.threads <= kMostThreads,
          fmt::format("--threads must be 1..{}", kMostThreads));
  require(options.run.memory_bytes >= 0, "--memory must not be negative");
  // Also refuses what is no number.
  require(options.run.checkpoint_s >= 0 && options.run.checkpoint_s <= 86400,
          "--checkpoint must be 0..86400 seconds");
  require(options.run.checkpoint_s > 0 || !options.run.keep_run,
          "--keep-run needs checkpoints: leave out --checkpoint 0");
  return rules;
}

double tolerance_at(const MeshOptions& options, std::int32_t zoom) {
  const auto own = options.tolerance_at_m.find(zoom);
  return own != options.tolerance_at_m.end() ? own->second : options.parameters.of("g_e").at(zoom);
}

ParameterValues parameters_at(const MeshOptions& options, std::int32_t zoom) {
  MethodParameters parameters = options.parameters;
  const auto own = options.tolerance_at_m.find(zoom);
  if (own != options.tolerance_at_m.end()) parameters.set("g_e", ZoomSeries({own->second}));
  return values_at(parameters, options.method, options.stop, zoom);
}

}  // namespace qmpipe
