// The posts that a finished tile set is measured against, recomputed from its source.
//
// With the set's recipe (ours): the same survey, reduction and void policy as the build's, so the
// posts are bit for bit those that the tiles were made from, and each zoom has its tolerance.
// Without (another program's set): the source sampled bilinearly at the zoom's posts; there is no
// tolerance then. Voids are marked and never count.
// Thread rule: const use is safe from several threads.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "formats/sources/raster_source.h"
#include "pipeline/recipe/recipe.h"
#include "pipeline/run/progress.h"
#include "scheduler/tiling_scheme.h"
#include "stages/finish/tile_error.h"
#include "stages/posts/heightfield.h"

namespace qmpipe::verify {

class SourcePosts {
 public:
  virtual ~SourcePosts() = default;
  // The tile's 257 x 257 posts; heights of voids are not to be used. None where the zoom is deeper
  // than the recipe's sampling zoom. Throws IoError when the source cannot be read.
  virtual std::optional<WindowHeights> posts(const TileKey& key) const = 0;
  virtual std::optional<double> tolerance_m(std::int32_t zoom) const = 0;
  // The height range of the valid posts of a tile and of the eight around it; 0 without a recipe.
  virtual double relief_near_m(const TileKey& key) const = 0;
  // How far the decoded tile is from the source's own posts: all of the sampling zoom that lie in it, no
  // wider apart than pixels and averaged with nothing, voids left out. None without a recipe, and where
  // posts() gives none.
  virtual std::optional<ErrorSummary> own_error(const TileKey& key,
                                                const QuantizedMesh& mesh) const = 0;
  // Tiles that the recipe asks for and the source has data for, sorted; empty without a recipe.
  virtual std::vector<TileKey> expected_tiles() const = 0;
  // What the inputs are, in order of priority.
  virtual const std::vector<RasterInfo>& sources() const = 0;
};

struct SourceOptions {
  std::vector<std::string> inputs;
  std::string source_crs;  // overrides the inputs' CRS when not empty
  std::int32_t threads = 1;
  // In place of the recipe's, one by one.
  HeightOptions heights = {};
};

// Throws IoError for an input that cannot be used, Interrupted when asked to stop.
std::unique_ptr<SourcePosts> open_source_posts(const SourceOptions& options,
                                               const TilingScheme& scheme,
                                               const std::optional<Recipe>& recipe,
                                               Progress& progress);

}  // namespace qmpipe::verify
