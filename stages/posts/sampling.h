// Heights at posts, read from rasters: the first step of a run.
//
// Guarantees: a post's height is a pure function of the post, the sources and the resampling
// (docs/decisions/0001-heights-are-functions-of-place.md): it does not depend on the window it was
// asked in, on the thread or on what was asked before. Sources are taken in the order given: the
// first that is valid at a post wins. Voids are NaN. A post lies on a raster when it lies within
// the outer edges of its pixels; it is void where the pixel that contains it is void. Interpolation
// uses the valid neighbours only, also those in other sources on the same grid
// (formats/sources/joined_grids.h), so that files which were cut from one raster give its heights;
// beyond the centres of the outermost pixels it repeats them (or goes on round the globe). What a
// raster wider than a turn round the globe has more than once is taken where it is valid, in the
// turn around its middle first. Places on the raster are exact to 0.01 pixel
// (stages/posts/post_positions.h). All posts of a pole row have one height, the mean of 64 of them.
// A Sampler is used by one thread at a time.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "formats/sources/raster_source.h"
#include "formats/sources/source_pool.h"
#include "scheduler/lattice.h"
#include "stages/posts/resampling.h"

namespace qmpipe {

class Sampler {
 public:
  // REQUIRES: at least one source.
  Sampler(SourcePool sources, Resampling resampling);
  ~Sampler();
  Sampler(Sampler&&) noexcept;

  // The height of every post of the window, in metres, row by row from the south. Columns wrap;
  // rows outside the lattice are void. REQUIRES: out.size() == window.size(). Throws IoError.
  void sample(const Lattice& lattice, const PostWindow& window, std::span<float> out);

  // True when some source's extent touches the window; false means all void without any reading.
  bool may_cover(const Lattice& lattice, const PostWindow& window) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// The coarsest zoom whose post spacing (at the equator) is no larger than the finest source pixel,
// to a millionth; at most kMaxZoom.
std::int32_t sampling_zoom_for(const TilingScheme& scheme, std::span<const RasterInfo> sources);

}  // namespace qmpipe
