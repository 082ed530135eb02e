// Random terrains, borders and slow oracles for the tests of stages/: everything seeded, nothing
// shared with the code that is tested.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "formats/run_store/lattice_store.h"
#include "formats/tile/quantized_mesh.h"
#include "stages/greedy/greedy.h"
#include "stages/surface/tin.h"

namespace qmpipe::testing {

enum class Terrain { kHills, kRidges, kCliffs, kFlat, kNoise, kSpikes, kAllEqual, kSteps };
inline constexpr std::array kTerrains = {Terrain::kHills,    Terrain::kRidges, Terrain::kCliffs,
                                         Terrain::kFlat,     Terrain::kNoise,  Terrain::kSpikes,
                                         Terrain::kAllEqual, Terrain::kSteps};
const char* name_of(Terrain terrain);

// 257 x 257 heights in metres, row by row from the south. kFlat is a tilted plane; kSteps has many
// equal heights and errors, so that ties are common.
std::vector<float> random_terrain(Terrain terrain, std::mt19937_64& random);

// The height of a post of the globe: smooth in the large, rough in the small, the same for both
// names of a column (i and i + columns).
float globe_height_m(std::uint64_t seed, const Lattice& lattice, std::int64_t i, std::int64_t j);
// A number in [0, 1) from a post.
double post_noise(std::uint64_t seed, std::int64_t i, std::int64_t j);

// Writes every block of a zoom; height_of(i, j) gives a post, NaN for a void.
template <class HeightOf>
void fill_zoom(LatticeStore& store, const Lattice& lattice, const HeightOf& height_of);

// Both ends, and each post between with the given probability.
BorderMask random_border(std::mt19937_64& random, double probability);
// Bit k of `sides` fixes the side with index k.
FixedBorders random_borders(std::mt19937_64& random, unsigned sides);

// One triangle and the weights of its corners at a place of the (u, v) plane.
struct Place {
  std::size_t triangle = 0;
  std::array<double, 3> weights{};
};
// For each of the tile's posts at its exact place, found by trying every triangle's bounding box in
// doubles. A post on an edge gets either triangle. `corners`: (u, v) of each vertex.
std::vector<Place> locate_posts_slowly(const PostGrid& grid,
                                       std::span<const std::array<double, 2>> corners,
                                       std::span<const std::uint32_t> indices);
// (u, v) of each vertex, as the file stores it.
std::vector<std::array<double, 2>> corners_of(const Tin& tin);

// What is wrong with a TIN as a partition of its rectangle: corners, orientation, area, twins,
// vertices used, posts at their places; empty when nothing is.
std::string fault_of(const PostGrid& grid, const Tin& tin);

// The largest error of a tile's post that is no vertex, at its exact place on the TIN's surface.
// Posts of fixed sides do not count: a neighbour answers for them.
double largest_error_m(const PostGrid& grid, const Tin& tin, std::span<const float> heights_m,
                       const FixedBorders& fixed);

template <class HeightOf>
void fill_zoom(LatticeStore& store, const Lattice& lattice, const HeightOf& height_of) {
  constexpr auto kSide = static_cast<std::size_t>(kBlockPosts);
  std::vector<float> block(kSide * kSide);
  for (std::int32_t by = 0; by * kBlockPosts < lattice.rows(); ++by) {
    for (std::int32_t bx = 0; bx * kBlockPosts < lattice.columns(); ++bx) {
      for (std::size_t k = 0; k < block.size(); ++k) {
        const std::int32_t i = bx * kBlockPosts + static_cast<std::int32_t>(k % kSide);
        const std::int32_t j = by * kBlockPosts + static_cast<std::int32_t>(k / kSide);
        block[k] = lattice.has_row(j) ? height_of(i, j) : std::numeric_limits<float>::quiet_NaN();
      }
      store.put_block({.zoom = lattice.zoom(), .x = bx, .y = by}, block);
    }
  }
}

}  // namespace qmpipe::testing
