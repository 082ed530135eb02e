#include "pipeline/tin/single_tin.h"

#include <fmt/format.h>

#include <limits>
#include <memory>

#include "formats/bytes/errors.h"
#include "pipeline/build/estimate.h"
#include "pipeline/common/process_memory.h"
#include "pipeline/common/stopwatch.h"
#include "scheduler/memory_budget.h"

namespace qmpipe {
namespace {

// Measured on DEMs of several million posts, rounded up: heights, flags, the method's own, the measure of
// the error. Greedy insertion grows with its triangles; this covers a quarter of the full grid's.
std::int64_t bytes_per_post(Method method) {
  switch (method) {
    case Method::kGreedy:
      return 80;
    case Method::kEdgeCollapse:
      return 520;
    case Method::kPsRandom:
    case Method::kPsGrid:
    case Method::kPsHierarchy:
    case Method::kPsWlop:
      break;
  }
  return 400;
}

void require_memory(const SingleTinOptions& options, const RasterInfo& info) {
  const std::int64_t limit = memory_limit_bytes(options.memory_bytes);
  const std::int64_t needed = single_tin_bytes(options.method, info.width * info.height);
  if (needed <= limit) return;
  throw UsageError(fmt::format(
      "{} x {} pixels with {} need about {} of memory, and there are {}{}; take fewer pixels with "
      "gdal_translate -outsize, a part with gdal_translate -srcwin, another method (greedy takes "
      "least), or make tiles with qmpipe build",
      info.width, info.height, name_of(options.method), bytes_text(needed), bytes_text(limit),
      options.memory_bytes == 0 ? " (nine tenths of this machine's)" : " (--memory)"));
}

void require_sound(const SingleTinOptions& options) {
  const TinTarget& target = options.target;
  if (target.tolerance_m && target.most_triangles) {
    throw UsageError("give --tolerance or --triangles, not both: each decides how fine the TIN is");
  }
  if (target.tolerance_m && !(*target.tolerance_m > 0)) {
    throw UsageError(fmt::format("--tolerance {:g}: give metres above 0", *target.tolerance_m));
  }
  constexpr std::int64_t kMostTriangles = std::numeric_limits<std::int32_t>::max();
  if (target.most_triangles &&
      (*target.most_triangles < 2 || *target.most_triangles > kMostTriangles)) {
    throw UsageError(fmt::format("--triangles {}: give 2 (a rectangle takes no fewer) to {}",
                                 *target.most_triangles, kMostTriangles));
  }
  if (target.tolerance_m && options.stop == Stop::kEdges) {
    throw UsageError(
        "--stop edges ends by the number of edges, which holds no tolerance; leave out --stop or "
        "--tolerance");
  }
}

}  // namespace

MethodParameters single_dem_parameters() {
  MethodParameters parameters;
  for (const auto& [name, value] : {std::pair{"g_e", 5.0},
                                    {"g_g", 0.0},
                                    {"e_e", 2000.0},
                                    {"p_e", 100.0},
                                    {"p_b", 5.0},
                                    {"p_m", 10.0},
                                    {"r_r", 98.5},
                                    {"d_g", 1000.0},
                                    {"h_c", 150.0},
                                    {"h_v", 1e-4},
                                    {"w_p", 1.5},
                                    {"w_r", 25.0},
                                    {"w_i", 15.0}}) {
    parameters.set(name, ZoomSeries({value}));
  }
  return parameters;
}

std::int64_t single_tin_bytes(Method method, std::int64_t post_count) {
  return kProgramBytes + post_count * bytes_per_post(method);
}

SingleTin make_single_tin(const SingleTinOptions& options) {
  require_sound(options);
  // First of all, before an hour's work shows that one is out of range.
  const TinMethod method = {options.method, options.stop,
                            values_at(options.parameters, options.method, options.stop, 0)};
  Stopwatch watch;
  const auto tally = std::make_shared<HeightTally>(options.guard);
  const std::unique_ptr<RasterSource> source =
      RasterSource::open(options.input, {.crs_override = options.source_crs,
                                         .heights = options.heights,
                                         .tally = tally,
                                         .placing = Placing::kPlane});
  post_spacing(source->info());
  require_memory(options, source->info());
  SingleTin single;
  single.dem = read_dem(*source);
  for (const HeightFinding& finding : tally->findings(options.heights)) {
    single.dem.info.assumptions.push_back(finding.text);
  }
  single.read_s = watch.lap();
  single.result = simplify_to_target(single.dem, method, options.target);
  single.simplify_s = watch.seconds();
  if (single.result.tin.indices.empty()) {
    throw IoError("cannot make a TIN of", options.input,
                  "its valid pixels are so few that every triangle is mostly void",
                  "take a finer tolerance, or cut the valid part out with gdal_translate -srcwin");
  }
  return single;
}

ExportMesh mesh_of(const SingleTin& single, TinFrame frame) {
  const PostGrid& grid = single.dem.grid;
  const PixelPlane& plane = single.dem.info.plane;
  ExportMesh mesh;
  mesh.indices = single.result.tin.indices;
  mesh.positions_m.reserve(single.result.tin.vertices.size());
  for (const TinVertex& vertex : single.result.tin.vertices) {
    if (frame == TinFrame::kLocal) {
      mesh.positions_m.push_back({(vertex.u - 0.5 * grid.u_max()) * grid.metres_per_u,
                                  (vertex.v - 0.5 * grid.v_max()) * grid.metres_per_v,
                                  vertex.height_m});
      continue;
    }
    const PixelPoint pixel = single.dem.pixel_of(vertex.u, vertex.v);
    mesh.positions_m.push_back({plane.x0 + plane.x_per_column * pixel.column,
                                plane.y0 + plane.y_per_row * pixel.row, vertex.height_m});
  }
  return mesh;
}

}  // namespace qmpipe
