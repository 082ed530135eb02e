// The vertical error of a decoded tile against its zoom's posts, and of a TIN against those it was
// made from: what a tolerance is held to (docs/decisions/0010-what-verify-promises.md, the third
// promise).
//
// A post that is a vertex is judged where the file puts the vertex (half a quantized unit from its
// exact place at most); every other post at its exact place on the surface. That is what a tolerance
// bounds. On slopes of more than a tolerance in half a unit, 1/65534 of the tile's side, the surface at
// such a post's exact place may be farther off; largest_in_place_m counts that too.
#pragma once

#include <span>

#include "formats/tile/quantized_mesh.h"
#include "stages/surface/tin.h"

namespace qmpipe {

struct ErrorSummary {
  std::int64_t posts = 0;  // valid posts judged
  double largest_m = 0;
  double largest_in_place_m = 0;  // of the surface at the exact place of every post
  double sum_m = 0;               // of magnitudes
  double sum_of_squares_m2 = 0;
  Post worst;  // of the grid, where largest_m was found first (lowest index)

  // One more post, this far off. Whether it is the worst is left to the caller, which knows the place.
  void count(double error_m);
  void add(const ErrorSummary& other);
  double mean_m() const;
  double rms_m() const;
};

// The decoded surface at each post of the tile; NaN where no triangle is. REQUIRES: a mesh that decoded.
std::vector<double> surface_at_posts(const PostGrid& grid, const QuantizedMesh& mesh);

// REQUIRES: a mesh that decoded; heights_m and valid of kTilePostCount. Posts that no triangle
// covers (a damaged tile of another program) are not counted.
ErrorSummary measure_error(const PostGrid& grid, const QuantizedMesh& mesh,
                           std::span<const float> heights_m, std::span<const std::uint8_t> valid);

// The same for a TIN. REQUIRES: heights_m and valid of grid.post_count().
ErrorSummary measure_error(const PostGrid& grid, const Tin& tin, std::span<const float> heights_m,
                           std::span<const std::uint8_t> valid);

}  // namespace qmpipe
