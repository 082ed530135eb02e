#include "formats/sources/joined_grids.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "formats/crs/numbers.h"
#include "formats/raster/placement.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

constexpr double kSamePlacePixels = 0.01;
// Of columns and rows from one raster of a grid to another: whole numbers that a double holds with
// room for hundredths.
constexpr double kFarthestPixels = 1e12;

// A raster among those of one grid, in columns and rows from the first of them.
struct Member {
  std::size_t raster = 0;
  std::int64_t column = 0;  // as its geotransform says, turns included
  std::int64_t row = 0;
  std::int64_t turned_column = 0;  // in 0 .. turn - 1 where there is a turn, else the same
};

struct Cluster {
  std::vector<Member> members;
  std::int64_t turn = 0;  // in columns; 0 where they do not close
};

auto digits_of(const PixelPlane& p) {
  return std::tuple(p.x_per_column, p.y_per_row, p.x_per_row, p.y_per_column, p.x0, p.y0);
}

// The same however the rasters are given.
std::vector<std::size_t> in_order_of_place(std::span<const RasterInfo> rasters) {
  std::vector<std::size_t> order(rasters.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto key = [&rasters](std::size_t k) {
    const RasterInfo& raster = rasters[k];
    return std::tuple_cat(digits_of(raster.plane), std::tuple(raster.width, raster.height, k));
  };
  std::sort(order.begin(), order.end(),
            [&key](std::size_t a, std::size_t b) { return key(a) < key(b); });
  return order;
}

std::optional<std::int64_t> whole_number(double value) {
  const double whole = std::round(value);
  if (!(std::abs(value - whole) <= kSamePlacePixels) || std::abs(whole) > kFarthestPixels) {
    return std::nullopt;
  }
  return static_cast<std::int64_t>(whole);
}

// Where a raster is on another's grid; none where their pixels do not fall on each other.
std::optional<Member> member_of(const RasterInfo& first, const RasterInfo& other) {
  const PixelPoint corner = first.plane.pixel_of({.x = other.plane.x0, .y = other.plane.y0});
  const std::optional<std::int64_t> column = whole_number(corner.column);
  const std::optional<std::int64_t> row = whole_number(corner.row);
  if (!column || !row) return std::nullopt;
  const double width = static_cast<double>(other.width);
  const double height = static_cast<double>(other.height);
  for (const PixelPoint& at : {PixelPoint{width, 0}, PixelPoint{0, height}}) {
    const PixelPoint there = first.plane.pixel_of(other.plane.map_of(at));
    if (!(std::abs(there.column - corner.column - at.column) <= kSamePlacePixels) ||
        !(std::abs(there.row - corner.row - at.row) <= kSamePlacePixels)) {
      return std::nullopt;
    }
  }
  return Member{.column = *column, .row = *row};
}

std::int64_t turned(std::int64_t column, std::int64_t turn) {
  return turn == 0 ? column : ((column % turn) + turn) % turn;
}

std::vector<Cluster> clusters_of(std::span<const RasterInfo> rasters) {
  CrsNumbers numbers;
  std::vector<std::size_t> crs;
  for (const RasterInfo& raster : rasters) {
    QMPIPE_CHECK(raster.placement != nullptr);
    crs.push_back(numbers.number_of(raster.placement->crs.text));
  }
  std::vector<Cluster> clusters;
  for (const std::size_t k : in_order_of_place(rasters)) {
    std::optional<Member> member;
    auto cluster = std::find_if(clusters.begin(), clusters.end(), [&](const Cluster& other) {
      const std::size_t first = other.members.front().raster;
      if (crs[first] == crs[k]) member = member_of(rasters[first], rasters[k]);
      return member.has_value();
    });
    if (cluster == clusters.end()) {
      cluster = clusters.emplace(clusters.end());
      cluster->turn = columns_of_a_turn(rasters[k]);
      member = Member{};
    }
    member->raster = k;
    member->turned_column = turned(member->column, cluster->turn);
    cluster->members.push_back(*member);
  }
  return clusters;
}

// The pixels of a member, and what touches them from the east and south.
struct Box {
  std::int64_t first_column = 0;
  std::int64_t end_column = 0;
  std::int64_t first_row = 0;
  std::int64_t end_row = 0;
  std::size_t member = 0;
};

std::vector<Box> boxes_of(std::span<const RasterInfo> rasters, const Cluster& cluster) {
  std::vector<Box> boxes;
  for (std::size_t m = 0; m < cluster.members.size(); ++m) {
    const Member& member = cluster.members[m];
    const RasterInfo& raster = rasters[member.raster];
    Box box{.first_column = member.turned_column,
            .end_column = member.turned_column + raster.width,
            .first_row = member.row,
            .end_row = member.row + raster.height,
            .member = m};
    boxes.push_back(box);
    // What reaches the line where the turn is full touches what begins there.
    if (cluster.turn == 0 || box.end_column < cluster.turn) continue;
    box.first_column -= cluster.turn;
    box.end_column -= cluster.turn;
    boxes.push_back(box);
  }
  return boxes;
}

class DisjointSets {
 public:
  explicit DisjointSets(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), std::size_t{0});
  }
  // The smallest of the set.
  std::size_t root(std::size_t k) {
    while (parent_[k] != k) k = parent_[k] = parent_[parent_[k]];
    return k;
  }
  void unite(std::size_t a, std::size_t b) {
    const std::size_t root_a = root(a);
    const std::size_t root_b = root(b);
    parent_[std::max(root_a, root_b)] = std::min(root_a, root_b);
  }

 private:
  std::vector<std::size_t> parent_;
};

// A cluster's members that touch, directly or through others.
std::vector<std::vector<Member>> touching(std::span<const RasterInfo> rasters,
                                          const Cluster& cluster) {
  std::vector<Box> boxes = boxes_of(rasters, cluster);
  std::sort(boxes.begin(), boxes.end(), [](const Box& a, const Box& b) {
    return std::tuple(a.first_column, a.member) < std::tuple(b.first_column, b.member);
  });
  DisjointSets sets(cluster.members.size());
  std::vector<Box> reached;  // by a line that goes east
  for (const Box& box : boxes) {
    std::erase_if(reached,
                  [&box](const Box& other) { return other.end_column < box.first_column; });
    for (const Box& other : reached) {
      if (other.first_row <= box.end_row && box.first_row <= other.end_row) {
        sets.unite(other.member, box.member);
      }
    }
    reached.push_back(box);
  }
  std::map<std::size_t, std::vector<Member>> parts;
  for (std::size_t m = 0; m < cluster.members.size(); ++m) {
    parts[sets.root(m)].push_back(cluster.members[m]);
  }
  std::vector<std::vector<Member>> result;
  for (auto& [root, members] : parts) result.push_back(std::move(members));
  return result;
}

struct Columns {
  std::int64_t first = 0;
  std::int64_t count = 0;
};

// The shortest range of columns that holds all members; all that there are where they leave no gap.
Columns columns_of(std::span<const RasterInfo> rasters, std::vector<Member> members,
                   std::int64_t turn) {
  const auto by_column = [](const Member& a, const Member& b) {
    return a.turned_column < b.turned_column;
  };
  std::sort(members.begin(), members.end(), by_column);
  const std::int64_t first = members.front().turned_column;
  // Of what members west of the one in hand cover; some may come from a turn further west.
  std::int64_t end = first;
  for (const Member& member : members) {
    if (turn == 0) break;
    end = std::max(end, member.turned_column + rasters[member.raster].width - turn);
  }
  std::int64_t widest = 0;
  std::int64_t after_widest = first;
  for (const Member& member : members) {
    if (member.turned_column - end > widest) {
      widest = member.turned_column - end;
      after_widest = member.turned_column;
    }
    end = std::max(end, member.turned_column + rasters[member.raster].width);
  }
  if (turn == 0) return {.first = first, .count = end - first};
  if (first + turn - end > widest) return {.first = first, .count = end - first};
  if (widest > 0) return {.first = after_widest, .count = turn - widest};
  // Once round: from where the first of them begins as it stands in the files.
  const Member& west =
      *std::min_element(members.begin(), members.end(),
                        [](const Member& a, const Member& b) { return a.column < b.column; });
  return {.first = west.turned_column, .count = turn};
}

// The plane whose first pixel is at a column and row of the members' own; in a file's own digits where
// one begins there.
PixelPlane plane_from(std::span<const RasterInfo> rasters, const std::vector<Member>& members,
                      const Cluster& cluster, std::int64_t column, std::int64_t row) {
  const auto first_of = [&members](const auto& is_wanted) {
    const Member* found = nullptr;
    for (const Member& member : members) {
      if (!is_wanted(member)) continue;
      if (found == nullptr || member.column < found->column) found = &member;
    }
    return found;
  };
  const Member* const corner =
      first_of([&](const Member& m) { return m.turned_column == column && m.row == row; });
  if (corner != nullptr) return rasters[corner->raster].plane;
  PixelPlane plane = rasters[cluster.members.front().raster].plane;
  const MapPoint at =
      plane.map_of({.column = static_cast<double>(column), .row = static_cast<double>(row)});
  plane.x0 = at.x;
  plane.y0 = at.y;
  if (!plane.is_axis_aligned()) return plane;
  const Member* const west = first_of([&](const Member& m) { return m.turned_column == column; });
  const Member* const north = first_of([&](const Member& m) { return m.row == row; });
  if (west != nullptr) plane.x0 = rasters[west->raster].plane.x0;
  if (north != nullptr) plane.y0 = rasters[north->raster].plane.y0;
  return plane;
}

void join(std::span<RasterInfo> rasters, const Cluster& cluster,
          const std::vector<Member>& members) {
  const Columns columns = columns_of(rasters, members, cluster.turn);
  std::int64_t first_row = members.front().row;
  std::int64_t end_row = first_row;
  for (const Member& member : members) {
    first_row = std::min(first_row, member.row);
    end_row = std::max(end_row, member.row + rasters[member.raster].height);
  }
  GridInfo shape;
  shape.width = columns.count;
  shape.height = end_row - first_row;
  shape.plane = plane_from(rasters, members, cluster, columns.first, first_row);
  const std::optional<RasterGrid> grid =
      RasterGrid::place(shape, rasters[members.front().raster].placement->crs);
  // Of parts that lie on the globe, the corners between them may not.
  if (!grid || !(grid->info().pixel_deg > 0) ||
      !(grid->info().bounds_deg.west_deg < grid->info().bounds_deg.east_deg)) {
    return;
  }
  const auto whole = std::make_shared<const GridInfo>(grid->info());
  for (const Member& member : members) {
    RasterInfo& raster = rasters[member.raster];
    raster.part.whole = whole;
    raster.part.column = turned(member.turned_column - columns.first, cluster.turn);
    raster.part.row = member.row - first_row;
    raster.pixel_deg = whole->pixel_deg;
  }
}

}  // namespace

void join_grids(std::span<RasterInfo> rasters) {
  for (const Cluster& cluster : clusters_of(rasters)) {
    for (const std::vector<Member>& members : touching(rasters, cluster)) {
      if (members.size() > 1) join(rasters, cluster, members);
    }
  }
}

}  // namespace qmpipe
