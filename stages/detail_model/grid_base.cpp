#include <array>
#include <cstdlib>
#include <optional>

#include "scheduler/check.h"
#include "scheduler/lattice.h"
#include "stages/detail_model/base.h"

namespace qmpipe {
namespace {

constexpr std::uint32_t kUnnumbered = 0xFFFFFFFF;

using PostTriangle = std::array<Post, 3>;

class GridBase {
 public:
  GridBase(const PostHeights& posts, const BlockGrid& grid)
      : posts_(posts), grid_(grid), number_(posts.z.size(), kUnnumbered) {
    base_.blocks.resize(static_cast<std::size_t>(grid.columns) *
                        static_cast<std::size_t>(grid.rows));
  }

  DetailBase run() {
    for_each_triangle([this](const PostTriangle& t) {
      if (is_in_one_block(t)) add_to_block(t);
    });
    for (std::size_t b = 0; b < base_.blocks.size(); ++b) separate(b);
    for_each_triangle([this](const PostTriangle& t) {
      if (!is_in_one_block(t)) add_to_seams(t);
    });
    return std::move(base_);
  }

 private:
  std::size_t at(const Post& p) const {
    return static_cast<std::size_t>(p.j) * static_cast<std::size_t>(posts_.columns) +
           static_cast<std::size_t>(p.i);
  }
  bool is_valid(const Post& p) const { return posts_.valid[at(p)] != 0; }

  // The box's middle (or third, ...) lies between posts or on one, which goes east and north.
  static std::int32_t part_of(std::int32_t i, std::int32_t posts, std::int32_t parts) {
    const std::int64_t part = std::int64_t{i} * parts / (posts - 1);
    return static_cast<std::int32_t>(std::min<std::int64_t>(part, parts - 1));
  }
  std::size_t block_of(const Post& p) const {
    const std::int32_t column = part_of(p.i, posts_.columns, grid_.columns);
    const std::int32_t row = part_of(p.j, posts_.rows, grid_.rows);
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(grid_.columns) +
           static_cast<std::size_t>(column);
  }
  bool is_in_one_block(const PostTriangle& t) const {
    const std::size_t block = block_of(t[0]);
    return block_of(t[1]) == block && block_of(t[2]) == block;
  }

  template <class Each>
  void for_each_triangle(const Each& each) const {
    for (std::int32_t j = 0; j + 1 < posts_.rows; ++j) {
      for (std::int32_t i = 0; i + 1 < posts_.columns; ++i) triangulate_cell({i, j}, each);
    }
  }

  template <class Each>
  void triangulate_cell(const Post& corner, const Each& each) const {
    // Counter-clockwise from the south-west.
    const std::array<Post, 4> c = {{{corner.i, corner.j},
                                    {corner.i + 1, corner.j},
                                    {corner.i + 1, corner.j + 1},
                                    {corner.i, corner.j + 1}}};
    std::size_t valid = 0;
    std::size_t absent = 0;
    for (std::size_t k = 0; k < c.size(); ++k) {
      is_valid(c[k]) ? ++valid : absent = k;
    }
    if (valid == 3) {
      each({c[(absent + 1) % 4], c[(absent + 2) % 4], c[(absent + 3) % 4]});
    } else if (valid == 4) {
      const auto rise = [&](std::size_t a, std::size_t b) {
        return std::abs(std::int64_t{posts_.z[at(c[a])]} - posts_.z[at(c[b])]);
      };
      const std::size_t first = rise(0, 2) <= rise(1, 3) ? 0 : 1;
      each({c[first], c[first + 1], c[first + 2]});
      each({c[first], c[first + 2], c[(first + 3) % 4]});
    }
  }

  std::uint32_t number_of(const Post& p) {
    std::uint32_t& number = number_[at(p)];
    if (number == kUnnumbered) {
      BaseBlock& block = base_.blocks[block_of(p)];
      number = static_cast<std::uint32_t>(block.points.size());
      block.points.push_back({.x = p.i, .y = p.j, .z = posts_.z[at(p)]});
    }
    return number;
  }

  void add_to_block(const PostTriangle& t) {
    BaseBlock& block = base_.blocks[block_of(t[0])];
    for (const Post& p : t) block.triangles.push_back(number_of(p));
  }

  void separate(std::size_t b) {
    BaseBlock& block = base_.blocks[b];
    std::vector<std::uint32_t> origin;
    const std::vector<DetailPoint> before = block.points;
    separate_fans(block.points, block.triangles, origin);
    block.mesh_points = block.points.size();
    for (std::size_t k = block.points.size(); k-- > 0;) {
      const DetailPoint& point = before[origin[k]];
      number_[at({point.x, point.y})] = static_cast<std::uint32_t>(k);
    }
  }

  void add_to_seams(const PostTriangle& t) {
    DetailSeam& seam = base_.seams.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) {
      seam[k] = {.block = static_cast<std::uint32_t>(block_of(t[k])), .point = number_of(t[k])};
    }
  }

  const PostHeights posts_;
  const BlockGrid grid_;
  DetailBase base_;
  std::vector<std::uint32_t> number_;  // of each post in its block
};

}  // namespace

DetailBase grid_base(const PostHeights& posts, const BlockGrid& grid) {
  QMPIPE_CHECK(posts.columns >= 2 && posts.rows >= 2);
  const std::size_t count =
      static_cast<std::size_t>(posts.columns) * static_cast<std::size_t>(posts.rows);
  QMPIPE_CHECK(posts.z.size() == count && posts.valid.size() == count);
  return GridBase(posts, grid).run();
}

}  // namespace qmpipe
