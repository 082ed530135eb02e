#include "pipeline/build/tile_builder.h"

#include <algorithm>

#include "scheduler/check.h"
#include "stages/finish/mesh_order.h"
#include "stages/finish/normals.h"
#include "stages/finish/quantize.h"
#include "stages/surface/border_line.h"
#include "stages/surface/curvature.h"

namespace qmpipe {
namespace {

// FNV-1a: names the content in layer.json's version, nothing more.
std::uint64_t hash_of(const TileKey& key, std::span<const std::uint8_t> bytes) {
  constexpr std::uint64_t kPrime = 0x100000001B3ULL;
  std::uint64_t hash = (0xCBF29CE484222325ULL ^ packed(key)) * kPrime;
  for (const std::uint8_t byte : bytes) hash = (hash ^ byte) * kPrime;
  return hash;
}

BorderMask meridian_border(const PostGrid& grid, std::span<const float> heights_m,
                           double tolerance_m, double side_depth_m, double step_m) {
  std::array<float, kTilePosts> line_m{};
  for (std::int32_t k = 0; k < kTilePosts; ++k) {
    line_m[static_cast<std::size_t>(k)] =
        heights_m[static_cast<std::size_t>(tile_post_index(0, k))];
  }
  BorderMask border = simplify_border(grid.v_exact, line_m, tolerance_m, step_m);
  const std::int32_t stride = side_stride_posts(grid, Side::kWest, side_depth_m);
  for (std::int32_t k = 0; k <= kTileIntervals; k += stride) border.set(k);
  return border;
}

}  // namespace

void TileBuilder::read_window(TileWork& work) const {
  const StageClock clock(work, Stage::kWindow);
  work.grid = std::make_unique<PostGrid>(make_tile_grid(heightfield_.scheme(), work.key));
  work.window = heightfield_.window(work.key.zoom, Lattice::tile_window(work.key, 1));
  work.heights_m.resize(kTilePostCount);
  work.valid.resize(kTilePostCount);
  for (std::int32_t j = 0; j < kTilePosts; ++j) {
    const auto from = static_cast<std::ptrdiff_t>(
        work.window.index(work.window.window.i0 + 1, work.window.window.j0 + 1 + j));
    const std::ptrdiff_t to = tile_post_index(0, j);
    std::copy_n(work.window.heights_m.begin() + from, kTilePosts, work.heights_m.begin() + to);
    std::copy_n(work.window.valid.begin() + from, kTilePosts, work.valid.begin() + to);
  }
  work.steps = recipe_.steps_for(work.key.zoom, work.heights_m);
}

void TileBuilder::simplify(TileWork& work, FixedBorders fixed, const PlannedTile& planned) const {
  const StageClock clock(work, Stage::kMesh);
  const auto zoom = static_cast<std::size_t>(work.key.zoom);
  for (const Side side : kSides) {
    if (planned.roles[index_of(side)] == SideRole::kSelf) {
      fixed[index_of(side)] =
          meridian_border(*work.grid, work.heights_m, recipe_.tolerance_m[zoom],
                          recipe_.side_depth_m(work.key.zoom), work.steps.side_m);
    }
  }
  const MethodOptions options = recipe_.options_for(work.key, work.steps);
  work.tin = strip_ordered(qmpipe::simplify(*work.grid, work.heights_m, fixed, options));
}

void TileBuilder::finish(TileWork& work) const {
  const StageClock clock(work, Stage::kFinish);
  work.mesh = quantize(*work.grid, work.tin, work.steps);
  if (recipe_.normals) {
    work.mesh.normals =
        tile_normals(heightfield_.scheme(), work.key, *work.grid, work.window, work.tin.vertices);
  }
  work.error = measure_error(*work.grid, work.mesh, work.heights_m, work.valid);
  work.vertices = work.mesh.vertex_count();
  work.triangles = work.mesh.triangle_count();
  work.grid.reset();
  work.window = {};
  work.heights_m = {};
  work.valid = {};
  work.tin = {};
}

void TileBuilder::encode_bytes(TileWork& work, GzipCompressor* compressor) const {
  const StageClock clock(work, Stage::kEncode);
  work.bytes = encode(work.mesh);
  work.mesh = {};
  work.plain_bytes = work.bytes.size();
  work.content_hash = hash_of(work.key, work.bytes);
  if (compressor != nullptr) work.bytes = compressor->compress(work.bytes);
}

}  // namespace qmpipe
