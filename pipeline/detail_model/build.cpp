#include "pipeline/detail_model/build.h"

#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "formats/bytes/errors.h"
#include "formats/sources/raster_source.h"
#include "pipeline/common/stopwatch.h"
#include "pipeline/run/source_notes.h"
#include "pipeline/tin/dem.h"
#include "stages/detail_model/block.h"
#include "stages/detail_model/simplify.h"

namespace qmpipe {
namespace {

void require_sound(const DetailBuildOptions& options) {
  if (!(options.keep_share > 0 && options.keep_share <= 1)) {
    throw UsageError(fmt::format("--keep {:g}%: give more than 0 and at most 100 per cent",
                                 100 * options.keep_share));
  }
  constexpr std::int32_t kMostBlocks = 65536;
  if (options.blocks < 1 || options.blocks > kMostBlocks) {
    throw UsageError(fmt::format("--blocks {}: give 1 to {}", options.blocks, kMostBlocks));
  }
  if (options.interval < 1) throw UsageError("--interval 0: give at least 1");
  if (!(options.height_step_m >= 0) || !std::isfinite(options.height_step_m)) {
    throw UsageError(fmt::format("--height-step {:g}: give metres above 0", options.height_step_m));
  }
}

bool are_whole_metres(const Dem& dem) {
  for (std::size_t k = 0; k < dem.heights_m.size(); ++k) {
    if (dem.valid[k] != 0 && dem.heights_m[k] != std::round(dem.heights_m[k])) return false;
  }
  return true;
}

// x and y of the south-western post: those of the CRS in metres, and of degrees none.
std::array<double, 2> origin_of(const Dem& dem) {
  if (dem.info.crs.is_geographic) return {0, 0};
  const PixelPoint pixel = dem.pixel_of(0, 0);
  const PixelPlane& plane = dem.info.plane;
  return {(plane.x0 + plane.x_per_column * pixel.column) * plane.unit,
          (plane.y0 + plane.y_per_row * pixel.row) * plane.unit};
}

DetailFrame frame_of(const Dem& dem, double height_step_m) {
  const PostSpacing spacing = post_spacing(dem.info);
  const auto [x_m, y_m] = origin_of(dem);
  const double step_m = height_step_m > 0 ? height_step_m : are_whole_metres(dem) ? 1.0 : 0.01;
  return {.offset = {x_m, y_m, 0}, .step_m = {spacing.x_m, spacing.y_m, step_m}};
}

std::vector<std::int32_t> rounded_heights(const Dem& dem, double step_m) {
  std::vector<std::int32_t> z(dem.heights_m.size());
  for (std::size_t k = 0; k < z.size(); ++k) {
    const double steps = std::round(dem.heights_m[k] / step_m);
    if (std::abs(steps) > kDetailGridMax) {
      throw UsageError(fmt::format("--height-step {:g}: a height of {:g} m has too many steps",
                                   step_m, dem.heights_m[k]));
    }
    z[k] = static_cast<std::int32_t>(steps);
  }
  return z;
}

// The finest mesh and where it lies.
struct Input {
  DetailBase base;
  DetailFrame frame;
  std::string crs_wkt;
};

void note_assumptions(const std::string& path, const std::vector<std::string>& assumptions,
                      Progress& progress) {
  for (const std::string& assumption : assumptions) {
    progress.note(fmt::format("{}: {}", path, assumption));
  }
}

Input read_dem_input(const DetailBuildOptions& options, Progress& progress,
                     DetailBuildReport& report) {
  Stopwatch watch;
  const auto tally = std::make_shared<HeightTally>(options.guard);
  const std::unique_ptr<RasterSource> source =
      RasterSource::open(options.input, {.crs_override = options.points.source_crs,
                                         .heights = options.heights,
                                         .tally = tally,
                                         .placing = Placing::kPlane});
  const Dem dem = read_dem(*source);
  note_assumptions(options.input, dem.info.assumptions, progress);
  note_findings(*tally, options.heights, progress);
  Input input;
  input.frame = frame_of(dem, options.height_step_m);
  input.crs_wkt = dem.info.crs.wkt;
  const std::vector<std::int32_t> z = rounded_heights(dem, input.frame.step_m[2]);
  report.read_s = watch.lap();
  input.base = grid_base(
      {.columns = dem.grid.width_posts, .rows = dem.grid.height_posts, .z = z, .valid = dem.valid},
      block_grid_of(options.blocks));
  report.triangulate_s = watch.seconds();
  std::size_t used = 0;
  for (const BaseBlock& block : input.base.blocks) used += block.points.size();
  report.left_out = static_cast<std::int64_t>(dem.post_count()) - static_cast<std::int64_t>(used);
  return input;
}

Input read_cloud_input(const DetailBuildOptions& options, Progress& progress,
                       DetailBuildReport& report) {
  if (!options.heights.is_default()) {
    throw UsageError(fmt::format("{} are for rasters, and {} holds points; leave them out",
                                 text_of(options.heights), options.input));
  }
  Stopwatch watch;
  const PointCloud cloud = read_point_cloud(options.input, options.points);
  note_assumptions(options.input, cloud.assumptions, progress);
  report.left_out = static_cast<std::int64_t>(cloud.counts.in_file) -
                    static_cast<std::int64_t>(cloud.points.size());
  report.left_out_text = left_out(cloud.counts);
  report.read_s = watch.lap();
  Input input;
  input.frame = cloud.frame;
  input.crs_wkt = cloud.crs_wkt;
  auto parts = split_into_blocks(cloud.points, block_grid_of(options.blocks));
  input.base.blocks.resize(parts.size());
  tbb::task_arena arena(options.threads);
  arena.execute([&] {
    tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t b) {
      input.base.blocks[b] = triangulate_block(std::move(parts[b]));
    });
  });
  input.base.seams = join_hulls(input.base.blocks);
  report.triangulate_s = watch.seconds();
  return input;
}

std::size_t triangle_count(const DetailBase& base) {
  std::size_t count = base.seams.size();
  for (const BaseBlock& block : base.blocks) count += block.triangles.size() / 3;
  return count;
}

}  // namespace

DetailModel simplify_base(DetailBase base, const DetailFrame& frame,
                          const DetailBuildOptions& options, Progress& progress,
                          DetailBuildReport& report) {
  const auto target = [&](const BaseBlock& block) {
    const std::size_t triangles = block.triangles.size() / 3;
    return static_cast<std::int64_t>(
        std::ceil(options.keep_share * static_cast<double>(triangles)));
  };
  std::int64_t to_do = 0;
  for (const BaseBlock& block : base.blocks) {
    to_do += (static_cast<std::int64_t>(block.triangles.size() / 3) - target(block)) / 2;
  }
  report.finest_triangles = static_cast<std::int64_t>(triangle_count(base));
  report.seam_triangles = static_cast<std::int64_t>(base.seams.size());
  std::vector<OrderedBlock> made(base.blocks.size());
  tbb::task_arena arena(options.threads);
  arena.execute([&] {
    const Phase phase(progress, "simplify", "collapses", to_do);
    tbb::parallel_for(std::size_t{0}, base.blocks.size(), [&](std::size_t b) {
      BaseBlock block = std::exchange(base.blocks[b], {});
      DetailRecord record;
      if (block.mesh_points > 0) {
        record =
            simplify_by_quadrics(std::span(block.points).first(block.mesh_points), block.triangles,
                                 frame, target(block), [&](std::int64_t collapses) {
                                   progress.advance(collapses);
                                   progress.check_stop();
                                 });
      }
      made[b] = make_detail_block(block.points, block.triangles, record);
    });
  });
  DetailModel model;
  model.frame = frame;
  model.interval = options.interval;
  std::vector<std::vector<std::uint32_t>> place(made.size());
  for (std::size_t b = 0; b < made.size(); ++b) {
    place[b].resize(made[b].order.size());
    for (std::size_t k = 0; k < made[b].order.size(); ++k) {
      place[b][made[b].order[k]] = static_cast<std::uint32_t>(k);
    }
    report.collapses += static_cast<std::int64_t>(made[b].block.levels());
    report.points += static_cast<std::int64_t>(made[b].block.points.size());
    model.blocks.push_back(std::move(made[b].block));
  }
  model.seams = std::move(base.seams);
  for (DetailSeam& seam : model.seams) {
    for (DetailCorner& corner : seam) corner.point = place[corner.block][corner.point];
  }
  report.coarsest_triangles = report.finest_triangles - 2 * report.collapses;
  return model;
}

DetailBuilt build_detail(const DetailBuildOptions& options, Progress& progress) {
  require_sound(options);
  DetailBuilt built;
  Input input = is_point_file(options.input) ? read_cloud_input(options, progress, built.report)
                                             : read_dem_input(options, progress, built.report);
  if (triangle_count(input.base) == 0) {
    throw IoError("cannot make a model of", options.input,
                  "there are no three valid points that make a triangle",
                  "check what is in it, as with gdalinfo -stats");
  }
  const Stopwatch watch;
  built.model = simplify_base(std::move(input.base), input.frame, options, progress, built.report);
  built.model.crs_wkt = input.crs_wkt;
  built.report.simplify_s = watch.seconds();
  return built;
}

}  // namespace qmpipe
