// A small sound tile set for the tests of `verify`, and ways to damage it.
//
// Sixteen tiles: zooms 0 and 1 whole, four tiles in a square at zoom 2 and one across the
// antimeridian from them, one tile at zoom 3; all their sides have a vertex at every 16th post, so
// that no build order is needed. Heights are positive.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "formats/tile/layer_json.h"
#include "formats/tile/quantized_mesh.h"
#include "pipeline/verify/verify.h"
#include "stages/posts/heightfield.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::testing {

inline constexpr TileKey kLeaf = {.zoom = 3, .x = 2, .y = 5};
inline constexpr TileKey kLeafParent = {.zoom = 2, .x = 1, .y = 2};
inline constexpr TileKey kWestTile = {.zoom = 2, .x = 0, .y = 2};  // west neighbour of kLeafParent
inline constexpr TileKey kBeforeAntimeridian = {.zoom = 2, .x = 7, .y = 2};

using HeightSource = std::function<WindowHeights(std::int32_t zoom, const PostWindow& window)>;

struct SetPlan {
  TilingScheme scheme{Projection::kGeodetic};
  std::vector<TileKey> keys;      // sorted
  double root_tolerance_m = 200;  // halved at each zoom
  double height_step_m = 0.75;
  HeightSource heights;
  std::string recipe_json;
};

// The plan of the set described above.
SetPlan sixteen_tiles();
// A mountainous globe of positive heights, without voids.
HeightSource smooth_globe(TilingScheme scheme);

class SetFixture {
 public:
  // An empty folder.
  SetFixture() = default;
  explicit SetFixture(const SetPlan& plan);

  std::filesystem::path path() const { return folder_.path(); }
  std::filesystem::path file_of(const TileKey& key) const;
  QuantizedMesh read(const TileKey& key) const;
  // Vertices are renumbered by first use before the tile is written.
  void write(const TileKey& key, const QuantizedMesh& mesh) const;
  void change(const TileKey& key, const std::function<void(QuantizedMesh&)>& damage) const;
  void put_bytes(const TileKey& key, const std::vector<std::uint8_t>& bytes) const;
  void change_layer(const std::function<void(LayerJson&)>& damage) const;
  void replace_in_layer(const std::string& from, const std::string& to) const;
  // Removes a tile, and takes it out of `available`.
  void remove_file(const TileKey& key) const;
  void unlist(const TileKey& key) const;
  void put(const std::string& name, const std::string& text) const { folder_.put(name, text); }

  verify::VerifyReport verify(const verify::VerifyOptions& options = {}) const;
  // The names of the kinds of faults that verify finds.
  std::set<std::string> fault_kinds(const verify::VerifyOptions& options = {}) const;
  std::set<std::string> warning_kinds() const;

 private:
  TemporaryFolder folder_;
};

// Parts of a mesh that tests damage.
std::size_t triangle_off_the_sides(const QuantizedMesh& mesh);
std::uint32_t vertex_inside(const QuantizedMesh& mesh);
// A vertex on the side that is no corner, and is not the tile's lowest or highest.
std::uint32_t vertex_on_side(const QuantizedMesh& mesh, Side side);
// Lowers one vertex on the side by a little more than 2 mm.
void sink_side(const SetFixture& set, const TileKey& key, Side side);
std::uint32_t add_vertex(QuantizedMesh& mesh, int u, int v, int h);

}  // namespace qmpipe::testing
