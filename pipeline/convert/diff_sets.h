// How two tile sets differ, in any of their forms: to see what an option, a version or another
// program did, or that packing lost nothing.
//
// Guarantees: whatever the sets hold, it ends with a report. The report depends on the sets alone,
// not on threads, and A and B may be exchanged: the same tiles in the same order. Memory does not
// grow with the sets beyond their keys.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/tile/tile_set.h"
#include "pipeline/convert/diff_layer.h"
#include "pipeline/convert/diff_mesh.h"
#include "pipeline/run/progress.h"

namespace qmpipe {

struct DiffOptions {
  std::int32_t threads = 1;
  // Tiles told of each kind (differing, only in A, only in B); all are counted.
  std::int64_t most_listed = 20;
};

struct TileDifference {
  TileKey key;
  // At least one of them cannot be read or decoded, and their bytes differ.
  bool is_undecodable = false;
  // What differs, in words.
  std::vector<std::string> parts = {};
  MeshDifference mesh = {};  // its `parts` are moved to the above
};

struct ZoomDiff {
  std::int32_t zoom = 0;
  std::int64_t tiles_a = 0;
  std::int64_t tiles_b = 0;
  std::int64_t only_in_a = 0;
  std::int64_t only_in_b = 0;
  std::int64_t same_bytes = 0;
  // Other bytes as stored, the same ones unpacked.
  std::int64_t same_unpacked = 0;
  std::int64_t different = 0;  // undecodable ones among them
  std::int64_t undecodable = 0;
  double largest_height_m = 0;  // as in MeshDifference
};

struct DiffReport {
  std::vector<LayerDifference> layer;
  std::vector<ZoomDiff> zooms;  // those with tiles, ascending
  ZoomDiff total;
  // The first ones, by key.
  std::vector<TileKey> only_in_a;
  std::vector<TileKey> only_in_b;
  // Worst first: undecodable ones; then by the largest distance of heights; by the posts that one
  // alone has; by key.
  std::vector<TileDifference> worst;

  // Nothing differs but, maybe, compression.
  bool is_same() const;
};

// Throws Interrupted when asked to stop.
DiffReport diff_sets(const TileSet& a, const TileSet& b, const DiffOptions& options,
                     Progress& progress);

// For people: layer.json, a table of the zooms, the tiles, and a line that sums up.
std::string text_of(const DiffReport& report);
// For programs: one JSON object; its keys are stable, lengths in metres, infinite ones null.
std::string json_of(const DiffReport& report);

}  // namespace qmpipe
