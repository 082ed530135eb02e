#include "tests/support/verify_fixture.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <stdexcept>

#include "formats/bytes/file_bytes.h"
#include "formats/bytes/gzip.h"
#include "formats/tile/layer_json.h"
#include "formats/tile/tile_path.h"
#include "formats/tile_sets/folder_sink.h"
#include "formats/tile_sets/open_tile_set.h"
#include "stages/finish/mesh_order.h"
#include "stages/finish/normals.h"
#include "stages/finish/quantize.h"
#include "stages/greedy/greedy.h"

namespace qmpipe::testing {
namespace {

constexpr std::uint32_t kUnseen = std::numeric_limits<std::uint32_t>::max();

FixedBorders regular_borders() {
  BorderMask mask;
  for (std::int32_t k = 0; k < kTilePosts; k += 16) mask.set(k);
  return {mask, mask, mask, mask};
}

std::vector<std::uint8_t> make_tile(const SetPlan& plan, const TileKey& key) {
  const WindowHeights with_halo = plan.heights(key.zoom, Lattice::tile_window(key, 1));
  const WindowHeights own = plan.heights(key.zoom, Lattice::tile_window(key, 0));
  const PostGrid grid = make_tile_grid(plan.scheme, key);
  const Tin tin =
      strip_ordered(greedy_insertion(grid, own.heights_m, regular_borders(),
                                     {.tolerance_m = std::ldexp(plan.root_tolerance_m, -key.zoom),
                                      .height_steps = plan.height_step_m,
                                      .initial_grid_cells = 8,
                                      .curvature = Curvature::kIgnored}));
  QuantizedMesh mesh = quantize(grid, tin, plan.height_step_m);
  mesh.normals = tile_normals(plan.scheme, key, grid, with_halo, tin.vertices);
  return gzip_compress(encode(mesh), 1);
}

// The order that encode() asks for; unused vertices come last.
QuantizedMesh renumbered(const QuantizedMesh& mesh) {
  std::vector<std::uint32_t> new_number(mesh.vertex_count(), kUnseen);
  std::vector<std::uint32_t> order;
  const auto visit = [&](std::uint32_t vertex) {
    if (new_number[vertex] != kUnseen) return;
    new_number[vertex] = static_cast<std::uint32_t>(order.size());
    order.push_back(vertex);
  };
  for (const std::uint32_t vertex : mesh.indices) visit(vertex);
  for (std::uint32_t k = 0; k < mesh.vertex_count(); ++k) visit(k);
  QuantizedMesh result = mesh;
  for (std::size_t k = 0; k < order.size(); ++k) {
    result.u[k] = mesh.u[order[k]];
    result.v[k] = mesh.v[order[k]];
    result.h[k] = mesh.h[order[k]];
    if (!mesh.normals.empty()) result.normals[k] = mesh.normals[order[k]];
  }
  for (std::uint32_t& vertex : result.indices) vertex = new_number[vertex];
  for (auto& side : result.sides) {
    for (std::uint32_t& vertex : side) vertex = new_number[vertex];
  }
  return result;
}

std::set<std::string> kinds_of(const std::vector<Finding>& findings) {
  std::set<std::string> kinds;
  for (const Finding& finding : findings) kinds.insert(name_of(finding.kind));
  return kinds;
}

bool is_inner(std::uint16_t coordinate) { return coordinate > 0 && coordinate < kQuantizedMax; }

}  // namespace

HeightSource smooth_globe(TilingScheme scheme) {
  return [scheme](std::int32_t zoom, const PostWindow& window) {
    const Lattice lattice(scheme, zoom);
    WindowHeights heights{.window = window, .heights_m = {}, .valid = {}};
    for (std::int64_t j = window.j0; j < window.j0 + window.height_posts; ++j) {
      for (std::int64_t i = window.i0; i < window.i0 + window.width_posts; ++i) {
        constexpr double kRadPerDeg = std::numbers::pi / 180;
        const bool exists = lattice.has_row(j);
        // Wrapped, so that both names of a column give the same bits.
        const double x = lattice.longitude_deg(lattice.wrap_column(i)) * kRadPerDeg;
        const double y = exists ? lattice.latitude_deg(j) * kRadPerDeg : 0;
        const double fade = std::cos(y) * std::cos(y);
        const double height_m = 1500 + 700 * std::sin(3 * x) * std::cos(4 * y) +
                                300 * std::sin(41 * x) * std::sin(37 * y);
        heights.heights_m.push_back(static_cast<float>(exists ? fade * height_m : 0));
        heights.valid.push_back(exists ? 1 : 0);
      }
    }
    return heights;
  };
}

SetPlan sixteen_tiles() {
  SetPlan plan;
  plan.keys = plan.scheme.roots();
  for (std::int32_t y = 0; y < 2; ++y) {
    for (std::int32_t x = 0; x < 4; ++x) plan.keys.push_back({.zoom = 1, .x = x, .y = y});
  }
  plan.keys.insert(plan.keys.end(), {kWestTile,
                                     kLeafParent,
                                     kBeforeAntimeridian,
                                     {.zoom = 2, .x = 0, .y = 3},
                                     {.zoom = 2, .x = 1, .y = 3},
                                     kLeaf});
  plan.heights = smooth_globe(plan.scheme);
  return plan;
}

SetFixture::SetFixture(const SetPlan& plan) {
  const auto sink = open_folder_sink(path(), Overwrite::kNo);
  LayerJson layer;
  layer.projection = plan.scheme.projection();
  layer.extensions = {"octvertexnormals"};
  layer.bounds_deg = {.west_deg = -180, .south_deg = -90, .east_deg = 180, .north_deg = 90};
  layer.qmpipe_json = plan.recipe_json;
  layer.max_zoom = plan.keys.back().zoom;
  std::map<std::int32_t, std::vector<TileKey>> by_zoom;
  for (const TileKey& key : plan.keys) {
    sink->write(key, make_tile(plan, key));
    by_zoom[key.zoom].push_back(key);
  }
  for (std::int32_t zoom = 0; zoom <= layer.max_zoom; ++zoom) {
    layer.available.push_back(merge_ranges(by_zoom[zoom]));
  }
  sink->close(write_layer_json(layer));
}

std::filesystem::path SetFixture::file_of(const TileKey& key) const {
  return path() / tile_file_name(key);
}

QuantizedMesh SetFixture::read(const TileKey& key) const {
  const auto stored = read_file_bytes(file_of(key), kLargestTileBytes);
  return decode(*plain_tile_bytes(*stored)).value();
}

void SetFixture::write(const TileKey& key, const QuantizedMesh& mesh) const {
  put_bytes(key, gzip_compress(encode(renumbered(mesh)), 1));
}

void SetFixture::put_bytes(const TileKey& key, const std::vector<std::uint8_t>& bytes) const {
  put(tile_file_name(key), std::string(bytes.begin(), bytes.end()));
}

void SetFixture::change(const TileKey& key,
                        const std::function<void(QuantizedMesh&)>& damage) const {
  QuantizedMesh mesh = read(key);
  damage(mesh);
  write(key, mesh);
}

void SetFixture::change_layer(const std::function<void(LayerJson&)>& damage) const {
  LayerJson layer = parse_layer_json(folder_.get("layer.json")).value().layer;
  damage(layer);
  put("layer.json", write_layer_json(layer));
}

void SetFixture::replace_in_layer(const std::string& from, const std::string& to) const {
  std::string text = folder_.get("layer.json");
  const std::size_t at = text.find(from);
  if (at == std::string::npos) throw std::logic_error("layer.json has no " + from);
  put("layer.json", text.replace(at, from.size(), to));
}

void SetFixture::remove_file(const TileKey& key) const {
  if (!std::filesystem::remove(file_of(key))) throw std::logic_error("no tile to remove");
}

void SetFixture::unlist(const TileKey& key) const {
  change_layer([&key](LayerJson& layer) {
    auto& ranges = layer.available[static_cast<std::size_t>(key.zoom)];
    std::vector<TileKey> keys;
    for (const TileRange& range : ranges) {
      for (std::int32_t y = range.start_y; y <= range.end_y; ++y) {
        for (std::int32_t x = range.start_x; x <= range.end_x; ++x) {
          keys.push_back({.zoom = key.zoom, .x = x, .y = y});
        }
      }
    }
    std::sort(keys.begin(), keys.end());
    std::erase(keys, key);
    ranges = merge_ranges(keys);
  });
}

verify::VerifyReport SetFixture::verify(const verify::VerifyOptions& options) const {
  Progress progress(ProgressStyle::kSilent, nullptr);
  return verify::verify_set(*open_tile_set(path()), options, progress);
}

std::set<std::string> SetFixture::fault_kinds(const verify::VerifyOptions& options) const {
  return kinds_of(verify(options).faults);
}

std::set<std::string> SetFixture::warning_kinds() const { return kinds_of(verify().warnings); }

std::uint32_t add_vertex(QuantizedMesh& mesh, int u, int v, int h) {
  mesh.u.push_back(static_cast<std::uint16_t>(u));
  mesh.v.push_back(static_cast<std::uint16_t>(v));
  mesh.h.push_back(static_cast<std::uint16_t>(h));
  if (!mesh.normals.empty()) mesh.normals.push_back(mesh.normals.front());
  return static_cast<std::uint32_t>(mesh.vertex_count() - 1);
}

std::size_t triangle_off_the_sides(const QuantizedMesh& mesh) {
  for (std::size_t t = 0; t < mesh.triangle_count(); ++t) {
    const auto first = mesh.indices.begin() + static_cast<std::ptrdiff_t>(3 * t);
    const bool is_off = std::all_of(first, first + 3, [&mesh](std::uint32_t k) {
      return is_inner(mesh.u[k]) && is_inner(mesh.v[k]);
    });
    if (is_off) return t;
  }
  throw std::logic_error("every triangle touches a side");
}

std::uint32_t vertex_inside(const QuantizedMesh& mesh) {
  return mesh.indices[3 * triangle_off_the_sides(mesh)];
}

std::uint32_t vertex_on_side(const QuantizedMesh& mesh, Side side) {
  for (const std::uint32_t k : mesh.sides[index_of(side)]) {
    const bool is_corner = !is_inner(mesh.u[k]) && !is_inner(mesh.v[k]);
    if (!is_corner && mesh.h[k] > 100 && mesh.h[k] < kQuantizedMax - 100) return k;
  }
  throw std::logic_error("no such vertex on the side");
}

void sink_side(const SetFixture& set, const TileKey& key, Side side) {
  set.change(key, [side](QuantizedMesh& mesh) {
    const double quantum_m =
        (mesh.header.max_height_m - mesh.header.min_height_m) / static_cast<double>(kQuantizedMax);
    std::uint16_t& h = mesh.h[vertex_on_side(mesh, side)];
    h = static_cast<std::uint16_t>(h - static_cast<int>(0.002 / quantum_m) - 1);
  });
}

}  // namespace qmpipe::testing
