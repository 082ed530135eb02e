#include "stages/posts/post_positions.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "scheduler/check.h"

namespace qmpipe {
namespace {

constexpr PixelPoint kNowhere = {std::numeric_limits<double>::quiet_NaN(),
                                 std::numeric_limits<double>::quiet_NaN()};

PixelPoint between(const PixelPoint& a, const PixelPoint& b, double part) {
  return {.column = a.column + (b.column - a.column) * part, .row = a.row + (b.row - a.row) * part};
}

// How far the middle of a side lies from where interpolation would put it; NaN when either is
// nowhere.
double bend(const PixelPoint& a, const PixelPoint& middle, const PixelPoint& b) {
  const PixelPoint straight = between(a, b, 0.5);
  const double columns = std::abs(middle.column - straight.column);
  const double rows = std::abs(middle.row - straight.row);
  // Not std::max, which may lose a NaN.
  return columns + rows;
}

// A square of posts between four anchors, and the anchors halfway.
struct PostCell {
  std::int64_t i = 0;
  std::int64_t j = 0;
  std::int32_t size_posts = 0;
  PixelPoint sw, se, nw, ne;
  // The middles of the sides.
  PixelPoint south = kNowhere;
  PixelPoint west = kNowhere;
  PixelPoint east = kNowhere;
  PixelPoint north = kNowhere;

  bool is_straight() const {
    return bend(sw, south, se) + bend(nw, north, ne) + bend(sw, west, nw) + bend(se, east, ne) <=
           kPositionTolerancePixels;
  }
};

class CellFiller {
 public:
  CellFiller(const RasterGrid& grid, const Lattice& lattice, const PostWindow& block,
             std::span<PixelPoint> out)
      : grid_(grid), lattice_(lattice), block_(block), out_(out) {}

  void fill_block();

 private:
  PixelPoint exact(std::int64_t i, std::int64_t j) const {
    return grid_.pixel_at(lattice_.longitude_deg(i), lattice_.latitude_deg(j)).value_or(kNowhere);
  }
  PixelPoint& at(std::int64_t i, std::int64_t j) const {
    const auto row = static_cast<std::size_t>(j - block_.j0);
    return out_[row * static_cast<std::size_t>(block_.width_posts) +
                static_cast<std::size_t>(i - block_.i0)];
  }
  // The posts a cell fills: its own and, in the lattice's last row of cells, the row that closes
  // it.
  PostRange posts_of(const PostCell& cell) const;
  void fill(const PostCell& cell) const;
  void interpolate(const PostCell& cell, const PostRange& posts) const;
  void split(const PostCell& cell) const;
  bool is_off_raster(const PostCell& cell) const;

  const RasterGrid& grid_;
  const Lattice& lattice_;
  const PostWindow& block_;
  std::span<PixelPoint> out_;
};

PostRange CellFiller::posts_of(const PostCell& cell) const {
  const bool is_last = cell.j + cell.size_posts == lattice_.rows() - 1;
  return {.i0 = std::max(cell.i, block_.i0),
          .j0 = std::max(cell.j, block_.j0),
          .i1 = std::min(cell.i + cell.size_posts, block_.i0 + block_.width_posts),
          .j1 = std::min(cell.j + cell.size_posts + (is_last ? 1 : 0),
                         block_.j0 + block_.height_posts)};
}

void CellFiller::fill(const PostCell& cell) const {
  const PostRange posts = posts_of(cell);
  if (posts.i0 >= posts.i1 || posts.j0 >= posts.j1) return;
  const PostRange closed{
      .i0 = cell.i, .j0 = cell.j, .i1 = cell.i + cell.size_posts, .j1 = cell.j + cell.size_posts};
  if (!touches_bounds(grid_.info(), lattice_, closed)) return;
  if (cell.is_straight()) {
    if (!is_off_raster(cell)) interpolate(cell, posts);
  } else {
    split(cell);
  }
}

bool CellFiller::is_off_raster(const PostCell& cell) const {
  const auto [left, right] =
      std::minmax({cell.sw.column, cell.se.column, cell.nw.column, cell.ne.column});
  const auto [top, bottom] = std::minmax({cell.sw.row, cell.se.row, cell.nw.row, cell.ne.row});
  return right < -1 || bottom < -1 || left > static_cast<double>(grid_.info().width) + 1 ||
         top > static_cast<double>(grid_.info().height) + 1;
}

void CellFiller::interpolate(const PostCell& cell, const PostRange& posts) const {
  const double step = 1.0 / cell.size_posts;
  for (std::int64_t j = posts.j0; j < posts.j1; ++j) {
    const double up = static_cast<double>(j - cell.j) * step;
    const PixelPoint west = between(cell.sw, cell.nw, up);
    const PixelPoint east = between(cell.se, cell.ne, up);
    PixelPoint* const row = &at(posts.i0, j);
    for (std::int64_t i = posts.i0; i < posts.i1; ++i) {
      row[i - posts.i0] = between(west, east, static_cast<double>(i - cell.i) * step);
    }
  }
}

void CellFiller::split(const PostCell& cell) const {
  const std::int32_t half = cell.size_posts / 2;
  if (half == 0) {
    const PostRange posts = posts_of(cell);
    for (std::int64_t j = posts.j0; j < posts.j1; ++j)
      at(cell.i, j) = j == cell.j ? cell.sw : cell.nw;
    return;
  }
  const PixelPoint centre = exact(cell.i + half, cell.j + half);
  std::array<PostCell, 4> quarters;
  quarters[0] = {.sw = cell.sw, .se = cell.south, .nw = cell.west, .ne = centre};
  quarters[1] = {.sw = cell.south, .se = cell.se, .nw = centre, .ne = cell.east};
  quarters[2] = {.sw = cell.west, .se = centre, .nw = cell.nw, .ne = cell.north};
  quarters[3] = {.sw = centre, .se = cell.east, .nw = cell.north, .ne = cell.ne};
  const std::int32_t quarter = half / 2;
  for (std::size_t k = 0; k < quarters.size(); ++k) {
    PostCell& part = quarters[k];
    part.i = cell.i + (k % 2 == 1 ? half : 0);
    part.j = cell.j + (k / 2 == 1 ? half : 0);
    part.size_posts = half;
    // Cells of one post have no middles: they are never straight, and split() ends with them.
    if (quarter > 0) {
      part.south = exact(part.i + quarter, part.j);
      part.north = exact(part.i + quarter, part.j + half);
      part.west = exact(part.i, part.j + quarter);
      part.east = exact(part.i + half, part.j + quarter);
    }
    fill(part);
  }
}

void CellFiller::fill_block() {
  const std::int64_t last_cell_row = (lattice_.rows() - 1) / kAnchorPosts - 1;
  const auto cell_row = [&](std::int64_t j) { return std::min(j / kAnchorPosts, last_cell_row); };
  const std::int64_t a0 = block_.i0 / kAnchorPosts;
  const std::int64_t a1 = (block_.i0 + block_.width_posts - 1) / kAnchorPosts;
  const std::int64_t b0 = cell_row(block_.j0);
  const std::int64_t b1 = cell_row(block_.j0 + block_.height_posts - 1);
  constexpr std::int32_t kHalf = kAnchorPosts / 2;
  // Anchors along the northern side of the row of cells in hand, and halfway between them.
  const auto cells = static_cast<std::size_t>(a1 - a0) + 1;
  std::vector<PixelPoint> below(2 * cells + 1);
  std::vector<PixelPoint> beside(cells + 1);
  std::vector<PixelPoint> above(2 * cells + 1);
  const auto along_row = [&](std::vector<PixelPoint>& row, std::int64_t j) {
    for (std::size_t k = 0; k < row.size(); ++k) {
      row[k] = exact(a0 * kAnchorPosts + static_cast<std::int64_t>(k) * kHalf, j);
    }
  };
  along_row(below, b0 * kAnchorPosts);
  for (std::int64_t b = b0; b <= b1; ++b) {
    const std::int64_t j = b * kAnchorPosts;
    along_row(above, j + kAnchorPosts);
    for (std::size_t k = 0; k < beside.size(); ++k) {
      beside[k] = exact((a0 + static_cast<std::int64_t>(k)) * kAnchorPosts, j + kHalf);
    }
    for (std::size_t k = 0; k < cells; ++k) {
      fill({.i = (a0 + static_cast<std::int64_t>(k)) * kAnchorPosts,
            .j = j,
            .size_posts = kAnchorPosts,
            .sw = below[2 * k],
            .se = below[2 * k + 2],
            .nw = above[2 * k],
            .ne = above[2 * k + 2],
            .south = below[2 * k + 1],
            .west = beside[k],
            .east = beside[k + 1],
            .north = above[2 * k + 1]});
    }
    below.swap(above);
  }
}

void locate_separable(const RasterGrid& grid, const Lattice& lattice, const PostWindow& block,
                      std::span<PixelPoint> out) {
  std::vector<double> columns(static_cast<std::size_t>(block.width_posts));
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const double longitude_deg = lattice.longitude_deg(block.i0 + static_cast<std::int64_t>(k));
    columns[k] = grid.pixel_at(longitude_deg, 0).value_or(kNowhere).column;
  }
  for (std::int32_t r = 0; r < block.height_posts; ++r) {
    const double row = grid.pixel_at(0, lattice.latitude_deg(block.j0 + r)).value_or(kNowhere).row;
    PixelPoint* const line = out.data() + static_cast<std::size_t>(r) * columns.size();
    for (std::size_t k = 0; k < columns.size(); ++k) line[k] = {.column = columns[k], .row = row};
  }
}

}  // namespace

void locate_posts(const RasterGrid& grid, const Lattice& lattice, const PostWindow& block,
                  std::span<PixelPoint> out) {
  QMPIPE_CHECK(block.i0 >= 0 && block.i0 + block.width_posts <= lattice.columns());
  QMPIPE_CHECK(block.j0 >= 0 && block.j0 + block.height_posts <= lattice.rows());
  QMPIPE_CHECK(out.size() == block.size());
  if (grid.info().is_separable) {
    locate_separable(grid, lattice, block, out);
  } else {
    std::fill(out.begin(), out.end(), kNowhere);
    CellFiller(grid, lattice, block, out).fill_block();
  }
}

bool touches_bounds(const GridInfo& info, const Lattice& lattice, const PostRange& range) {
  const RectangleDeg& b = info.bounds_deg;
  const double width_deg = b.east_deg - b.west_deg;
  const double height_deg = b.north_deg - b.south_deg;
  const double slack_deg = 2 * info.pixel_deg + 1e-4 * std::max(width_deg, height_deg);
  if (lattice.latitude_deg(range.j1) < b.south_deg - slack_deg) return false;
  if (lattice.latitude_deg(range.j0) > b.north_deg + slack_deg) return false;
  // How far east of the bounds' western end the range begins, in [0, 360).
  const double west_deg = b.west_deg - slack_deg;
  const double ahead_deg = lattice.longitude_deg(range.i0) - west_deg;
  const double turned_deg = ahead_deg - 360 * std::floor(ahead_deg / 360);
  const double range_deg = static_cast<double>(range.i1 - range.i0) * lattice.column_spacing_deg();
  return turned_deg <= width_deg + 2 * slack_deg || turned_deg + range_deg >= 360;
}

}  // namespace qmpipe
