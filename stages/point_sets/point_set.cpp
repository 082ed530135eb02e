#include "stages/point_sets/point_set.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "scheduler/check.h"
#include "stages/point_sets/point_subset.h"
#include "stages/point_sets/polylines.h"
#include "stages/point_sets/sharp_edges.h"
#include "stages/point_sets/wlop.h"
#include "stages/posts/height_step.h"
#include "stages/surface/base_tin.h"
#include "stages/surface/constrained_delaunay.h"
#include "stages/surface/curvature.h"
#include "stages/surface/metric_frame.h"

namespace qmpipe {
namespace {

class PointSetSimplification {
 public:
  PointSetSimplification(const PostGrid& grid, std::span<const float> heights_m,
                         const FixedBorders& fixed, const PointSetOptions& options)
      : grid_(grid),
        options_(options),
        base_(base_tin(grid, heights_m, fixed, options.height_steps)),
        heights_m_(grid.post_count(), 0.0) {
    const auto by_height = [](const TinVertex& a, const TinVertex& b) {
      return a.height_m < b.height_m;
    };
    const auto range = std::minmax_element(base_.vertices.begin(), base_.vertices.end(), by_height);
    lowest_m_ = range.first->height_m;
    highest_m_ = range.second->height_m;
    for (const TinVertex& vertex : base_.vertices) heights_m_[at(vertex.post)] = vertex.height_m;
    add_borders(fixed);
    add_sharp_edges();
  }

  Tin run() {
    const auto before = polylines_;
    polylines_ = simplify_polylines(grid_, heights_m_, before, options_.polyline_error_m);
    std::vector<TinVertex> vertices;
    for (const Polyline& polyline : polylines_) {
      for (const std::int32_t post : polyline.posts) vertices.push_back(vertex_at(post));
    }
    // Of two at one place the polyline's stays.
    for (const TinVertex& vertex : kept_points(posts_beside(before))) vertices.push_back(vertex);
    return triangulated(std::move(vertices));
  }

 private:
  static std::size_t at(std::int32_t k) { return static_cast<std::size_t>(k); }
  TinVertex vertex_at(std::int32_t post) const {
    return {.u = grid_.u[at(grid_.column(post))],
            .v = grid_.v[at(grid_.row(post))],
            .post = post,
            .height_m = heights_m_[at(post)]};
  }
  bool is_on_side(std::int32_t post, Side side) const;
  void add_borders(const FixedBorders& fixed);
  void add_sharp_edges();
  std::vector<std::int32_t> posts_beside(std::span<const Polyline> polylines) const;
  std::vector<TinVertex> kept_points(std::span<const std::int32_t> posts) const;
  std::vector<TinVertex> projected_points(std::span<const std::int32_t> posts) const;
  TinVertex vertex_near(const SurfacePoint& point, const MetricFrame& frame) const;
  Tin triangulated(std::vector<TinVertex> vertices) const;

  const PostGrid& grid_;
  const PointSetOptions& options_;
  Tin base_;
  std::vector<double> heights_m_;  // on steps, by post
  double lowest_m_ = 0;
  double highest_m_ = 0;
  std::vector<Polyline> polylines_;
};

bool PointSetSimplification::is_on_side(std::int32_t post, Side side) const {
  switch (side) {
    case Side::kWest:
      return grid_.column(post) == 0;
    case Side::kSouth:
      return grid_.row(post) == 0;
    case Side::kEast:
      return grid_.column(post) == grid_.width_posts - 1;
    case Side::kNorth:
      return grid_.row(post) == grid_.height_posts - 1;
  }
  return false;
}

// On a fixed side the base has exactly the posts that must stay.
void PointSetSimplification::add_borders(const FixedBorders& fixed) {
  for (const Side side : kSides) {
    const bool is_vertical = side == Side::kWest || side == Side::kEast;
    const double length = is_vertical ? grid_.v_max() : grid_.u_max();
    double longest = length * options_.longest_border_edge_percent / 100;
    if (!std::isinf(options_.side_depth_m)) {
      longest = std::min(
          longest, length / kTileIntervals * side_stride_posts(grid_, side, options_.side_depth_m));
    }
    polylines_.push_back({.posts = {}, .longest_edge = fixed[index_of(side)] ? 0 : longest});
    for (const TinVertex& vertex : base_.vertices) {
      if (is_on_side(vertex.post, side)) polylines_.back().posts.push_back(vertex.post);
    }
  }
}

void PointSetSimplification::add_sharp_edges() {
  const auto sharp = sharp_polylines(base_, {.angle_deg = options_.sharp_angle_deg,
                                             .least_points = options_.least_polyline_points});
  for (const VertexPolyline& vertices : sharp) {
    polylines_.emplace_back();
    for (const std::uint32_t k : vertices) {
      polylines_.back().posts.push_back(base_.vertices[k].post);
    }
  }
}

// The posts inside the rectangle that are in no polyline.
std::vector<std::int32_t> PointSetSimplification::posts_beside(
    std::span<const Polyline> polylines) const {
  std::vector<std::uint8_t> taken(grid_.post_count(), 0);
  for (const Polyline& polyline : polylines) {
    for (const std::int32_t post : polyline.posts) taken[at(post)] = 1;
  }
  std::vector<std::int32_t> posts;
  for (std::int32_t j = 1; j + 1 < grid_.height_posts; ++j) {
    for (std::int32_t i = 1; i + 1 < grid_.width_posts; ++i) {
      if (taken[at(grid_.index(i, j))] == 0) posts.push_back(grid_.index(i, j));
    }
  }
  return posts;
}

std::vector<TinVertex> PointSetSimplification::kept_points(
    std::span<const std::int32_t> posts) const {
  if (options_.method == PointSetMethod::kWlop) return projected_points(posts);
  std::vector<Vec3> positions;
  if (options_.method != PointSetMethod::kRandom) {
    const MetricFrame frame(grid_);
    positions.reserve(posts.size());
    for (const std::int32_t post : posts) {
      positions.push_back(frame.position(post, heights_m_[at(post)]));
    }
  }
  PointIndices kept;
  switch (options_.method) {
    case PointSetMethod::kRandom:
      kept = random_subset(posts.size(), options_.removed_percent, options_.seed);
      break;
    case PointSetMethod::kGrid:
      kept = grid_subset(positions, options_.cell_size_m, options_.seed);
      break;
    case PointSetMethod::kHierarchy:
      kept = hierarchy_subset(positions, options_.cluster_size, options_.surface_variation);
      break;
    case PointSetMethod::kWlop:
      break;
  }
  std::vector<TinVertex> vertices;
  vertices.reserve(kept.size());
  for (const std::uint32_t k : kept) vertices.push_back(vertex_at(posts[k]));
  return vertices;
}

std::vector<TinVertex> PointSetSimplification::projected_points(
    std::span<const std::int32_t> posts) const {
  const MetricFrame frame(grid_);
  std::vector<SurfacePoint> points;
  points.reserve(posts.size());
  for (const std::int32_t post : posts) {
    const double height_m = heights_m_[at(post)];
    points.push_back({.position = frame.position(post, height_m), .height_m = height_m});
  }
  PointIndices sample = random_sample(
      points.size(), share_of(points.size(), options_.retained_percent), options_.seed);
  std::sort(sample.begin(), sample.end());
  const auto moved =
      wlop(points, sample, frame,
           {.neighbour_radius_m = options_.neighbour_radius_m, .iterations = options_.iterations});
  std::vector<TinVertex> vertices;
  vertices.reserve(moved.size());
  for (std::size_t k = 0; k < moved.size(); ++k) {
    // A post's exact place may lie half-way between two integers: only one that has moved is rounded.
    const bool stayed = moved[k].position == points[sample[k]].position;
    vertices.push_back(stayed ? vertex_at(posts[sample[k]]) : vertex_near(moved[k], frame));
  }
  return vertices;
}

TinVertex PointSetSimplification::vertex_near(const SurfacePoint& point,
                                              const MetricFrame& frame) const {
  const MetricFrame::Place place = frame.place_of(point.position);
  const auto inside = [](double x, std::int32_t max) {
    return static_cast<std::int32_t>(std::clamp(std::floor(x + 0.5), 1.0, max - 1.0));
  };
  TinVertex vertex{.u = inside(place.u, grid_.u_max()),
                   .v = inside(place.v, grid_.v_max()),
                   .post = kNoPost,
                   .height_m = snapped_height(std::clamp(point.height_m, lowest_m_, highest_m_),
                                              options_.height_steps.inner_m)};
  const std::int32_t post = post_at(grid_, vertex.u, vertex.v);
  if (post == kNoPost) return vertex;
  const TinVertex at_post = vertex_at(post);
  return at_post.height_m == vertex.height_m ? at_post : vertex;
}

Tin PointSetSimplification::triangulated(std::vector<TinVertex> vertices) const {
  const auto before = [](const TinVertex& a, const TinVertex& b) {
    return a.v != b.v ? a.v < b.v : a.u < b.u;
  };
  const auto same_place = [](const TinVertex& a, const TinVertex& b) {
    return a.u == b.u && a.v == b.v;
  };
  std::stable_sort(vertices.begin(), vertices.end(), before);
  vertices.erase(std::unique(vertices.begin(), vertices.end(), same_place), vertices.end());
  std::vector<IntPoint> places;
  places.reserve(vertices.size());
  for (const TinVertex& vertex : vertices) places.push_back({vertex.u, vertex.v});
  const auto number_of = [&](std::int32_t post) {
    const auto found = std::lower_bound(vertices.begin(), vertices.end(), vertex_at(post), before);
    return static_cast<std::uint32_t>(found - vertices.begin());
  };
  std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
  for (const Polyline& polyline : polylines_) {
    for (std::size_t k = 1; k < polyline.posts.size(); ++k) {
      edges.emplace_back(number_of(polyline.posts[k - 1]), number_of(polyline.posts[k]));
    }
  }
  std::vector<std::uint32_t> indices = constrained_delaunay(places, edges);
  return {.vertices = std::move(vertices), .indices = std::move(indices)};
}

void check(const PointSetOptions& o) {
  const auto is_percentage = [](double x) { return x >= 0 && x <= 100; };
  QMPIPE_CHECK(o.height_steps.inner_m > 0 && o.polyline_error_m >= 0);
  QMPIPE_CHECK(is_percentage(o.longest_border_edge_percent));
  QMPIPE_CHECK(is_percentage(o.removed_percent) && is_percentage(o.retained_percent));
  QMPIPE_CHECK(o.cell_size_m > 0 && o.neighbour_radius_m > 0);
  QMPIPE_CHECK(o.cluster_size >= 1 && o.surface_variation >= 0 && o.iterations >= 0);
}

}  // namespace

Tin simplify_point_set(const PostGrid& grid, std::span<const float> heights_m,
                       const FixedBorders& fixed, const PointSetOptions& options) {
  check(options);
  return PointSetSimplification(grid, heights_m, fixed, options).run();
}

}  // namespace qmpipe
