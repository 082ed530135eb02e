// The posts of a window in metres, without voids: what the mesh of a tile is made from.
//
// Guarantees: a post's height is a pure function of the post, the lattice store and the void
// policy, so two windows agree on every post they share, whatever each sees around it. Posts of a
// pole row have one height. Below the policy's base zoom, a void post that is one of the coarser zoom
// too has that zoom's height.
// const use is safe from several threads.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "formats/run_store/lattice_store.h"
#include "scheduler/lattice.h"

namespace qmpipe {

struct VoidPolicy {
  enum class Kind {
    // The heights of the coarser zooms' valid posts, fading to base_height_m: no cliffs, no sunken
    // globe. DEFAULT.
    kPull,
    // base_height_m at once.
    kHeight,
    // As kPull; tiles with a void are written only where a tile below them or the format needs them.
    kOmit,
  };
  Kind kind = Kind::kPull;
  double base_height_m = 0;
  // Over which distance on the ground heights fade; 0: as far as the data's rim needs. DEFAULT: 0.
  double fade_m = 0;
  // The zoom at which voids are base_height_m. A void of a deeper zoom lies on the surface of the zoom
  // above it, so that all zooms show one surface outside the data.
  std::int32_t base_zoom = 0;
  friend bool operator==(const VoidPolicy&, const VoidPolicy&) = default;
};

// The one height of each pole row of a zoom, where the data reach it: south, north.
using PoleHeights = std::array<std::optional<float>, 2>;

struct WindowHeights {
  PostWindow window;
  std::vector<float> heights_m;     // all finite
  std::vector<std::uint8_t> valid;  // 1 where the post is no void
  std::size_t index(std::int64_t i, std::int64_t j) const {
    return static_cast<std::size_t>(j - window.j0) * static_cast<std::size_t>(window.width_posts) +
           static_cast<std::size_t>(i - window.i0);
  }
  float height_m(std::int64_t i, std::int64_t j) const { return heights_m[index(i, j)]; }
};

class Heightfield {
 public:
  // REQUIRES: `store` outlives this; pole_heights[zoom] for every zoom that is read (may be empty
  // in the mercator scheme).
  Heightfield(const LatticeStore& store, TilingScheme scheme, VoidPolicy policy,
              std::vector<PoleHeights> pole_heights);

  WindowHeights window(std::int32_t zoom, const PostWindow& window) const;
  const TilingScheme& scheme() const { return scheme_; }

 private:
  void fill(const Lattice& lattice, const PostWindow& window, std::vector<float>& heights_m) const;
  void fill_pole_rows(const Lattice& lattice, const PostWindow& window,
                      std::vector<float>& heights_m) const;
  float pole_height_m(std::int32_t zoom, std::size_t pole) const;
  // The coarsest zoom from which voids of this one take heights.
  std::int32_t coarsest_for(std::int32_t zoom) const;

  const LatticeStore& store_;
  TilingScheme scheme_;
  VoidPolicy policy_;
  std::vector<PoleHeights> pole_heights_;
};

}  // namespace qmpipe
