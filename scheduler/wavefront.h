// The order in which tiles are built, as a pure function of which tiles there are.
//
// Colours by parity (docs/decisions/0002-four-colours.md): a common side is owned by the tile of
// the lower colour, the other inherits its border. So a tile of colour 0 waits for nobody, 1 for
// its west and east neighbours, 2 for south and north, 3 for all four; the longest chain is 0 -> 1
// or 2 -> 3. Tiles that meet only in a corner owe each other nothing, since corners are always
// vertices.
//
// Guarantees of a plan: every tile stands in it exactly once; every tile stands after all tiles it
// waits for; tiles of one colour share no side (across the antimeridian too); who owns which side
// depends on keys alone. Within a zoom the order is by rows (0, 2, 1, 4, 3, ...), so that the
// wavefront stays narrow and borders are soon used up; zooms follow each other, coarse first, and no
// tile waits for one of another zoom.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "scheduler/tiling_scheme.h"

namespace qmpipe {

enum class SideRole : std::uint8_t {
  kAlone,  // no tile beyond: this tile decides, nobody else needs the border
  kOwner,  // this tile decides and publishes
  kHeir,   // the neighbour decides; this tile waits for it
  kSelf,   // the tile is its own neighbour (the mercator root): both sides by a rule of their own
};

using TileIndex = std::int32_t;
inline constexpr TileIndex kNoTile = -1;

struct PlannedTile {
  TileKey key;
  // By index_of(Side): the tile across (kNoTile for none) and who decides.
  std::array<TileIndex, 4> neighbours{kNoTile, kNoTile, kNoTile, kNoTile};
  std::array<SideRole, 4> roles{};
  // Tiles that this one waits for. Counted once a side: in a zoom of two columns the same tile is
  // the neighbour on both sides.
  std::int32_t in_degree = 0;
};

struct WavefrontPlan {
  // In the order of the schedule.
  std::vector<PlannedTile> tiles;
};

// REQUIRES: keys sorted, no key twice, all inside the scheme.
WavefrontPlan plan_wavefront(const TilingScheme& scheme, std::span<const TileKey> keys);

}  // namespace qmpipe
