#include "stages/greedy.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>

#include "formats/quantized_mesh.h"
#include "scheduler/check.h"
#include "stages/curvature.h"
#include "stages/delaunay.h"
#include "stages/height_step.h"
#include "stages/triangle_scan.h"
#include "stages/worst_post.h"

namespace qmpipe {
namespace {

using Index = Delaunay::Index;

constexpr std::size_t at(Index i) { return static_cast<std::size_t>(i); }

struct Candidate {
  float error = 0;
  std::int32_t post = -1;
  Index triangle = Delaunay::kNone;
  std::uint32_t version = 0;  // of the triangle; an older one is stale
};

// The worst post first; of equal ones the one with the lowest index.
struct LessUrgent {
  bool operator()(const Candidate& a, const Candidate& b) const {
    if (a.error != b.error) return a.error < b.error;
    if (a.post != b.post) return a.post > b.post;
    return a.triangle > b.triangle;
  }
};

// The middle of the tile's heights, on a step, and how far the farthest lies from it.
struct HeightRange {
  double middle_m = 0;
  double reach_m = 0;
};

HeightRange height_range(std::span<const float> heights_m, double step_m) {
  QMPIPE_CHECK(heights_m.size() == kTilePostCount && step_m > 0);
  const auto [low, high] = std::minmax_element(heights_m.begin(), heights_m.end());
  QMPIPE_CHECK(std::isfinite(*low) && std::isfinite(*high));
  const double middle_m = snapped_height(0.5 * (static_cast<double>(*low) + *high), step_m);
  return {.middle_m = middle_m,
          .reach_m = std::max(std::abs(*low - middle_m), std::abs(*high - middle_m)) + step_m};
}

class GreedyInsertion {
 public:
  GreedyInsertion(const TileGrid& grid, std::span<const float> heights_m, const FixedBorders& fixed,
                  const GreedyOptions& options);
  Tin run();

 private:
  void insert_initial_vertices(const FixedBorders& fixed);
  void insert_post(std::int32_t post, Index near);
  void evaluate(Index triangle);
  Worst worst_post(Index triangle) const;
  Worst worst_free_post(Index triangle) const;
  template <class Row>
  void for_each_row(Index triangle, const Row& row) const;

  // A row of a plane: the value at post i is at_first + step * i.
  struct PlaneRow {
    double at_first = 0;
    double step = 0;
    RowLine from(std::int32_t i) const {
      return {.start = static_cast<float>(at_first + step * i), .step = static_cast<float>(step)};
    }
  };
  struct TrianglePlanes {
    Plane height;
    Plane latitude_squared;
    Plane longitude_squared;
  };
  TrianglePlanes planes_of(Index triangle) const;
  PlaneRow height_row(const TrianglePlanes& planes, std::int32_t j) const;
  PlaneRow curved_row(const TrianglePlanes& planes, std::int32_t j) const;
  double vertex_height(Index vertex) const { return vertex_heights_[at(vertex)]; }
  // From the height as given: a neighbour with another base must snap a common post alike.
  double snapped(std::int32_t post) const {
    return snapped_height(static_cast<double>(source_heights_m_[at(post)]),
                          options_.height_step_m) -
           base_m_;
  }

  const TileGrid& grid_;
  std::span<const float> source_heights_m_;
  const GreedyOptions& options_;
  Delaunay mesh_;
  std::vector<std::int32_t> posts_;     // post of each vertex
  std::vector<double> vertex_heights_;  // snapped, less base_m_
  std::vector<std::uint8_t> blocked_;   // posts that are vertices already or lie on a fixed side
  // Heights less base_m_: differences of floats near each other lose nothing, so the error of a
  // float sum stays far below a tolerance even in the Himalayas.
  HeightRange range_;
  double base_m_ = 0;
  std::vector<float> heights_;
  bool curved_ = false;
  CurvatureTerms curvature_;
  std::vector<float> curved_heights_;  // heights_ plus the curvature's term
  float threshold_ = 0;
  std::vector<std::uint32_t> versions_;
  std::priority_queue<Candidate, std::vector<Candidate>, LessUrgent> queue_;
};

GreedyInsertion::GreedyInsertion(const TileGrid& grid, std::span<const float> heights_m,
                                 const FixedBorders& fixed, const GreedyOptions& options)
    : grid_(grid),
      source_heights_m_(heights_m),
      options_(options),
      mesh_(kQuantizedMax),
      blocked_(kTilePostCount, 0),
      range_(height_range(heights_m, options.height_step_m)),
      base_m_(range_.middle_m),
      heights_(kTilePostCount + WorstPost::kOverread),
      curvature_(curvature_terms(grid)) {
  QMPIPE_CHECK(options.tolerance_m > options.height_step_m / 2);
  for (std::size_t k = 0; k < kTilePostCount; ++k) {
    heights_[k] = static_cast<float>(static_cast<double>(heights_m[k]) - base_m_);
  }
  // What float arithmetic may lose on the way comes off the tolerance, so that the bound is true.
  const double rounding =
      6 * range_.reach_m * static_cast<double>(std::numeric_limits<float>::epsilon());
  threshold_ =
      static_cast<float>(std::max(options.tolerance_m - rounding, options.tolerance_m / 2));

  curved_ =
      options.curvature == Curvature::kCounts && largest_sagitta_m(grid) > options.tolerance_m / 64;
  if (curved_) {
    curved_heights_.resize(kTilePostCount + WorstPost::kOverread);
    for (std::int32_t j = 0; j < kTilePosts; ++j) {
      for (std::int32_t i = 0; i < kTilePosts; ++i) {
        const std::size_t k = at(tile_post_index(i, j));
        curved_heights_[k] = static_cast<float>(heights_[k] + curvature_.at(i, j));
      }
    }
  }
  insert_initial_vertices(fixed);
}

void GreedyInsertion::insert_post(std::int32_t post, Index near) {
  const std::int32_t i = post % kTilePosts;
  const std::int32_t j = post / kTilePosts;
  const Index vertex = mesh_.insert({grid_.u[at(i)], grid_.v[at(j)]}, near);
  blocked_[at(post)] = 1;
  if (vertex != static_cast<Index>(posts_.size())) return;  // was a vertex before
  posts_.push_back(post);
  vertex_heights_.push_back(snapped(post));
}

void GreedyInsertion::insert_initial_vertices(const FixedBorders& fixed) {
  constexpr std::int32_t kEnd = kTileIntervals;
  // The triangulation begins with these four, in this order.
  for (const std::int32_t post : {tile_post_index(0, 0), tile_post_index(kEnd, 0),
                                  tile_post_index(kEnd, kEnd), tile_post_index(0, kEnd)}) {
    posts_.push_back(post);
    vertex_heights_.push_back(snapped(post));
    blocked_[at(post)] = 1;
  }
  const auto last = [this] { return mesh_.touched().empty() ? 0 : mesh_.touched().back(); };
  for (const Side side : kSides) {
    const auto& mask = fixed[index_of(side)];
    if (!mask) continue;
    QMPIPE_CHECK(mask->test(0) && mask->test(kEnd));
    for (std::int32_t k = 0; k <= kEnd; ++k) {
      const Post p = side_post(side, k);
      if (mask->test(k)) insert_post(tile_post_index(p.i, p.j), last());
      blocked_[at(tile_post_index(p.i, p.j))] = 1;
    }
  }
  const std::int32_t cells = options_.initial_grid_cells;
  for (std::int32_t row = 0; cells > 0 && row <= cells; ++row) {
    for (std::int32_t column = 0; column <= cells; ++column) {
      const std::int32_t post = tile_post_index(column * kEnd / cells, row * kEnd / cells);
      if (blocked_[at(post)] == 0) insert_post(post, last());
    }
  }
}

template <class Row>
void GreedyInsertion::for_each_row(Index triangle, const Row& row) const {
  std::int32_t j_first = kTileIntervals;
  std::int32_t j_last = 0;
  for (int k = 0; k < 3; ++k) {
    const std::int32_t j = posts_[at(mesh_.vertex(triangle, k))] / kTilePosts;
    j_first = std::min(j_first, j);
    j_last = std::max(j_last, j);
  }
  scan_triangle(grid_, mesh_.point(mesh_.vertex(triangle, 0)),
                mesh_.point(mesh_.vertex(triangle, 1)), mesh_.point(mesh_.vertex(triangle, 2)), 1.0,
                j_first, j_last, row);
}

GreedyInsertion::TrianglePlanes GreedyInsertion::planes_of(Index triangle) const {
  const Index a = mesh_.vertex(triangle, 0);
  const Index b = mesh_.vertex(triangle, 1);
  const Index c = mesh_.vertex(triangle, 2);
  const auto plane = [&](double za, double zb, double zc) {
    return plane_through(mesh_.point(a), mesh_.point(b), mesh_.point(c), za, zb, zc);
  };
  TrianglePlanes planes;
  planes.height = plane(vertex_height(a), vertex_height(b), vertex_height(c));
  if (curved_) {
    const auto latitude = [&](Index v) { return curvature_.latitude_squared_at(mesh_.point(v).y); };
    const auto longitude = [&](Index v) {
      return curvature_.longitude_squared_at(mesh_.point(v).x);
    };
    planes.latitude_squared = plane(latitude(a), latitude(b), latitude(c));
    planes.longitude_squared = plane(longitude(a), longitude(b), longitude(c));
  }
  return planes;
}

constexpr double kUnitsPerPost = static_cast<double>(kQuantizedMax) / kTileIntervals;

GreedyInsertion::PlaneRow GreedyInsertion::height_row(const TrianglePlanes& planes,
                                                      std::int32_t j) const {
  const double v = grid_.v_exact[at(j)];
  return {.at_first = planes.height.at(0, v), .step = planes.height.du * kUnitsPerPost};
}

GreedyInsertion::PlaneRow GreedyInsertion::curved_row(const TrianglePlanes& planes,
                                                      std::int32_t j) const {
  const double v = grid_.v_exact[at(j)];
  const double parallel = curvature_.parallel_scale[at(j)];
  const double start =
      planes.latitude_squared.at(0, v) + parallel * planes.longitude_squared.at(0, v);
  const double step = planes.latitude_squared.du + parallel * planes.longitude_squared.du;
  return {.at_first = planes.height.at(0, v) + curvature_.metres_per_unit * start,
          .step = (planes.height.du + curvature_.metres_per_unit * step) * kUnitsPerPost};
}

Worst GreedyInsertion::worst_post(Index triangle) const {
  const TrianglePlanes planes = planes_of(triangle);
  WorstPost worst;
  for_each_row(triangle, [&](std::int32_t j, std::int32_t i_first, std::int32_t i_last) {
    const std::int32_t first = tile_post_index(i_first, j);
    const std::int32_t n = i_last - i_first + 1;
    const RowLine line = height_row(planes, j).from(i_first);
    if (curved_) {
      worst.look(heights_.data() + first, line, curved_heights_.data() + first,
                 curved_row(planes, j).from(i_first), first, n);
    } else {
      worst.look(heights_.data() + first, line, first, n);
    }
  });
  return worst.result();
}

// As worst_post(), but passes over posts that cannot be inserted. Rarely needed: a vertex has an
// error only from the rounding of its place.
Worst GreedyInsertion::worst_free_post(Index triangle) const {
  const TrianglePlanes planes = planes_of(triangle);
  Worst worst;
  for_each_row(triangle, [&](std::int32_t j, std::int32_t i_first, std::int32_t i_last) {
    const PlaneRow flat = height_row(planes, j);
    const PlaneRow bent = curved_ ? curved_row(planes, j) : PlaneRow{};
    for (std::int32_t i = i_first; i <= i_last; ++i) {
      const std::int32_t post = tile_post_index(i, j);
      if (blocked_[at(post)] != 0) continue;
      double error = std::abs(flat.at_first + flat.step * i - heights_[at(post)]);
      if (curved_) {
        error =
            std::max(error, std::abs(bent.at_first + bent.step * i - curved_heights_[at(post)]));
      }
      if (static_cast<float>(error) > worst.error) worst = {static_cast<float>(error), post};
    }
  });
  return worst;
}

void GreedyInsertion::evaluate(Index triangle) {
  if (at(triangle) >= versions_.size()) versions_.resize(at(triangle) + 1, 0);
  const std::uint32_t version = ++versions_[at(triangle)];
  Worst worst = worst_post(triangle);
  if (worst.error <= threshold_) return;
  if (blocked_[at(worst.post)] != 0) worst = worst_free_post(triangle);
  if (worst.error <= threshold_) return;
  queue_.push({worst.error, worst.post, triangle, version});
}

Tin GreedyInsertion::run() {
  for (Index t = 0; t < mesh_.triangle_count(); ++t) evaluate(t);
  while (!queue_.empty()) {
    const Candidate next = queue_.top();
    queue_.pop();
    if (next.version != versions_[at(next.triangle)]) continue;
    if (blocked_[at(next.post)] != 0) {
      // A neighbour has inserted this post, and the rounding of its place kept this triangle whole.
      evaluate(next.triangle);
      continue;
    }
    insert_post(next.post, next.triangle);
    for (const Index t : mesh_.touched()) evaluate(t);
    // The rounding of its place may have put the vertex into a neighbour and left this triangle
    // whole, whose other posts would be forgotten.
    if (next.version == versions_[at(next.triangle)]) evaluate(next.triangle);
  }
  Tin tin;
  tin.posts = posts_;
  tin.indices.reserve(3 * at(mesh_.triangle_count()));
  for (Index t = 0; t < mesh_.triangle_count(); ++t) {
    for (int k = 0; k < 3; ++k) {
      tin.indices.push_back(static_cast<std::uint32_t>(mesh_.vertex(t, k)));
    }
  }
  return tin;
}

}  // namespace

Tin greedy_insertion(const TileGrid& grid, std::span<const float> heights_m,
                     const FixedBorders& fixed, const GreedyOptions& options) {
  return GreedyInsertion(grid, heights_m, fixed, options).run();
}

}  // namespace qmpipe
