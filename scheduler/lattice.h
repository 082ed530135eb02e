// The integer grid of all posts of one zoom.
//
// A tile spans 256 x 256 intervals, that is 257 x 257 posts; neighbouring tiles share the posts on
// their common side. Post (i, j) counts i eastwards from longitude -180 and j northwards from the
// scheme's southern limit; post (i, j) of zoom z is post (2i, 2j) of zoom z+1, at exactly the same
// longitude and latitude (bit for bit). Columns wrap: post (i + columns, j) is post (i, j).
// Indices have 64 bits: the deepest zoom has 2^33 columns.
#pragma once

#include <cstdint>

#include "scheduler/tiling_scheme.h"

namespace qmpipe {

inline constexpr std::int32_t kTileIntervals = 256;
inline constexpr std::int32_t kTilePosts = kTileIntervals + 1;

// A post of one tile's own grid, counted from its south-west corner.
struct Post {
  std::int32_t i = 0;
  std::int32_t j = 0;
  friend constexpr bool operator==(const Post&, const Post&) = default;
};

// A post of a zoom's lattice.
struct LatticePost {
  std::int64_t i = 0;
  std::int64_t j = 0;
  friend constexpr bool operator==(const LatticePost&, const LatticePost&) = default;
};

// Posts i0 .. i0 + width - 1, j0 .. j0 + height - 1. Columns may lie outside the lattice (they
// wrap); rows outside it do not exist.
struct PostWindow {
  std::int64_t i0 = 0;
  std::int64_t j0 = 0;
  std::int32_t width_posts = 0;
  std::int32_t height_posts = 0;

  std::size_t size() const {
    return static_cast<std::size_t>(width_posts) * static_cast<std::size_t>(height_posts);
  }
  friend constexpr bool operator==(const PostWindow&, const PostWindow&) = default;
};

// The lattice index of the first post of column or row `tile` of tiles.
constexpr std::int64_t first_post(std::int32_t tile) { return std::int64_t{tile} * kTileIntervals; }

class Lattice {
 public:
  Lattice(TilingScheme scheme, std::int32_t zoom);

  std::int32_t zoom() const { return zoom_; }
  const TilingScheme& scheme() const { return scheme_; }
  // Different columns; column columns() is column 0 again.
  std::int64_t columns() const { return columns_; }
  // Rows, both ends included: 256 * tile rows + 1.
  std::int64_t rows() const { return rows_; }
  bool has_row(std::int64_t j) const { return j >= 0 && j < rows_; }
  // True where all posts of the row are one point of the globe (geodetic scheme only).
  bool is_pole_row(std::int64_t j) const {
    return scheme_.projection() == Projection::kGeodetic && (j == 0 || j == rows_ - 1);
  }
  std::int64_t wrap_column(std::int64_t i) const {
    const std::int64_t r = i % columns_;
    return r < 0 ? r + columns_ : r;
  }

  // Longitude of column i; not wrapped: column columns() is +180.
  double longitude_deg(std::int64_t i) const;
  double latitude_deg(std::int64_t j) const;
  // The inverses, in posts, not rounded and not clamped (row_at() in the mercator scheme takes
  // latitudes beyond +-85.06 degrees as that limit).
  double column_at(double longitude_deg) const;
  double row_at(double latitude_deg) const;
  // Distance between columns; in the geodetic scheme also between rows.
  double column_spacing_deg() const;

  // The 257 x 257 posts of a tile, widened by `halo_posts` on every side.
  static PostWindow tile_window(const TileKey& key, std::int32_t halo_posts);

 private:
  TilingScheme scheme_;
  std::int32_t zoom_;
  std::int64_t columns_;
  std::int64_t rows_;
};

}  // namespace qmpipe
