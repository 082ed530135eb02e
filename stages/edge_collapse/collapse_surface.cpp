#include "stages/edge_collapse/collapse_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "scheduler/check.h"
#include "stages/surface/curvature.h"

namespace qmpipe {
namespace {
std::uint8_t bit(Side side) { return static_cast<std::uint8_t>(1U << index_of(side)); }
}  // namespace

CollapseSurface::HeightRange CollapseSurface::height_range(const Tin& tin) {
  const auto [low, high] = std::minmax_element(
      tin.vertices.begin(), tin.vertices.end(),
      [](const TinVertex& a, const TinVertex& b) { return a.height_m < b.height_m; });
  return {.low_m = low->height_m, .high_m = high->height_m};
}

CollapseSurface::CollapseSurface(const PostGrid& grid, const Tin& tin, const FixedBorders& fixed,
                                 const HeightSteps& height_steps, double side_depth_m,
                                 const CollapseWeights& weights)
    : grid_(grid),
      weights_(weights),
      height_steps_(height_steps),
      heights_(height_range(tin)),
      mesh_(tin.indices, tin.vertices.size()),
      vertices_(tin.vertices) {
  QMPIPE_CHECK(height_steps.inner_m > 0);
  scale_ = {1.0 / grid.u_max(), 1.0 / grid.v_max(),
            heights_.high_m > heights_.low_m ? 1 / (heights_.high_m - heights_.low_m) : 0.0};
  for (const Side side : kSides) {
    if (fixed[index_of(side)]) fixed_sides_ |= bit(side);
    strides_[index_of(side)] = std::isinf(side_depth_m)
                                   ? grid.width_posts + grid.height_posts
                                   : side_stride_posts(grid, side, side_depth_m);
  }
  start();
}

bool CollapseSurface::is_pinned(Index v) const {
  const std::uint8_t sides = sides_[at(v)];
  if ((sides & (sides - 1U)) != 0) return true;
  for (const Side side : kSides) {
    if ((sides & bit(side)) == 0) continue;
    const std::int32_t post = vertices_[at(v)].post;
    const bool is_vertical = side == Side::kWest || side == Side::kEast;
    const std::int32_t along = is_vertical ? grid_.row(post) : grid_.column(post);
    return along % strides_[index_of(side)] == 0;
  }
  return false;
}

void CollapseSurface::start() {
  sides_.clear();
  places_.clear();
  for (const TinVertex& vertex : vertices_) {
    std::uint8_t sides = 0;
    if (vertex.u == 0) sides |= bit(Side::kWest);
    if (vertex.v == 0) sides |= bit(Side::kSouth);
    if (vertex.u == grid_.u_max()) sides |= bit(Side::kEast);
    if (vertex.v == grid_.v_max()) sides |= bit(Side::kNorth);
    sides_.push_back(sides);
    places_.push_back(scaled(vertex));
  }
  sums_.resize(vertices_.size());
  for (Index v = 0; v < mesh_.vertex_count(); ++v) update_sums(v);
}

void CollapseSurface::compact() {
  Tin left = tin();
  mesh_ = CollapseMesh(left.indices, left.vertices.size());
  vertices_ = std::move(left.vertices);
  start();
}

void CollapseSurface::update_sums(Index v) {
  StarSums sums;
  const Vector3 here = places_[at(v)];
  mesh_.each_leaving(v, [&](Index e) {
    const Vector3 first = places_[at(mesh_.target(e))] - here;
    const Index back = CollapseMesh::previous(e);
    const Vector3 second = places_[at(mesh_.origin(back))] - here;
    sums.add_triangle(cross(first, second));
    sums.add_neighbour(first);
    if (mesh_.on_hull(back)) sums.add_neighbour(second);
  });
  sums_[at(v)] = sums;
}

EdgeQuadric CollapseSurface::quadric(Index e) const {
  const Index a = mesh_.origin(e);
  const Index b = mesh_.target(e);
  const Vector3 here = places_[at(a)];
  const Vector3 along = places_[at(b)] - here;
  std::array<EdgeTriangle, 2> shared;
  std::size_t count = 0;
  for (const Index h : {e, mesh_.twin(e)}) {
    if (h == kNone) continue;
    const Vector3 tip = places_[at(mesh_.origin(CollapseMesh::previous(h)))] - here;
    shared[count++] = {.normal = h == e ? cross(along, tip) : cross(tip, along), .tip = tip};
  }
  return EdgeQuadric(sums_[at(a)], sums_[at(b)], along, std::span(shared).first(count));
}

double CollapseSurface::boundary_cost(Index e, const Vector3& place) const {
  double sum = 0;
  const auto add = [&](Index h) {
    const Vector3 from = places_[at(mesh_.origin(h))];
    const Vector3 to = places_[at(mesh_.target(h))];
    const Vector3 swept = cross(to - from, to - place);
    sum += dot(swept, swept) / 4;
  };
  // An end on the hull has two of its edges; e itself is counted once.
  for (const Index end : {mesh_.origin(e), mesh_.target(e)}) {
    if (!mesh_.vertex_on_hull(end)) continue;
    mesh_.each_leaving(end, [&](Index k) {
      if (mesh_.on_hull(k)) add(k);
      const Index back = CollapseMesh::previous(k);
      if (mesh_.on_hull(back) && back != e) add(back);
    });
  }
  return sum;
}

double CollapseSurface::cost_of(Index e, const EdgeQuadric& quadric, const Vector3& place) const {
  const bool both_on_hull = mesh_.on_hull(e);
  // With one end on the hull the vertex is that end, and the hull's edges sweep nothing.
  const double boundary = both_on_hull ? boundary_cost(e, place) : 0;
  return quadric.cost(place - places_[at(mesh_.origin(e))], boundary, weights_);
}

CollapseSurface::Plan CollapseSurface::keeping(Index e, const EdgeQuadric& quadric,
                                               Index kept) const {
  const Vector3& place = places_[at(kept)];
  return {.place = place, .kept = kept, .cost = cost_of(e, quadric, place)};
}

TinVertex CollapseSurface::rounded(const Vector3& place) const {
  // Bounds first: a place far outside does not fit an integer.
  const auto units = [](double scaled, std::int32_t size) {
    return static_cast<std::int32_t>(
        std::lround(std::clamp(scaled * size, 1.0, static_cast<double>(size - 1))));
  };
  const double height_m = scale_.z > 0 ? std::clamp(heights_.low_m + place.z / scale_.z,
                                                    heights_.low_m, heights_.high_m)
                                       : heights_.low_m;
  return {.u = units(place.x, grid_.u_max()),
          .v = units(place.y, grid_.v_max()),
          .post = kNoPost,
          .height_m = snapped_height(height_m, height_steps_.inner_m)};
}

std::optional<CollapseSurface::Plan> CollapseSurface::plan(Index e) const {
  const Index a = mesh_.origin(e);
  const Index b = mesh_.target(e);
  const std::uint8_t on_a = sides_[at(a)];
  const std::uint8_t on_b = sides_[at(b)];
  if (on_a != 0 && on_b != 0) {
    // A chord through the inside would pinch the tile, and a fixed side is another tile's.
    const bool is_fixed = (on_a & on_b & fixed_sides_) != 0;
    if (!mesh_.on_hull(e) || is_fixed || (is_pinned(a) && is_pinned(b))) return std::nullopt;
  }
  const EdgeQuadric sums = quadric(e);
  if (on_a == 0 && on_b == 0) {
    const auto offset = sums.best_place();
    if (!offset) return std::nullopt;
    const Vector3 place = places_[at(a)] + *offset;
    return Plan{.place = place, .kept = kNone, .cost = cost_of(e, sums, place)};
  }
  if (on_b == 0 || is_pinned(a)) return keeping(e, sums, a);
  if (on_a == 0 || is_pinned(b)) return keeping(e, sums, b);
  const Plan keep_a = keeping(e, sums, a);
  const Plan keep_b = keeping(e, sums, b);
  if (keep_a.cost != keep_b.cost) return keep_a.cost < keep_b.cost ? keep_a : keep_b;
  return vertices_[at(a)].post < vertices_[at(b)].post ? keep_a : keep_b;
}

CollapseSurface::Candidate CollapseSurface::candidate(Index e, const Plan& plan) const {
  if (plan.kept != kNone) return {vertices_[at(plan.kept)], plan.kept, plan.cost};
  const TinVertex vertex = rounded(plan.place);
  for (const Index end : {mesh_.origin(e), mesh_.target(e)}) {
    const TinVertex& old = vertices_[at(end)];
    if (old.u == vertex.u && old.v == vertex.v && old.height_m == vertex.height_m) {
      return {old, end, plan.cost};
    }
  }
  return {vertex, kNone, plan.cost};
}

std::optional<double> CollapseSurface::cost(Index e) const {
  const auto place = plan(e);
  return place ? std::optional(place->cost) : std::nullopt;
}

std::optional<CollapseSurface::Candidate> CollapseSurface::best(Index e) const {
  const auto place = plan(e);
  return place ? std::optional(candidate(e, *place)) : std::nullopt;
}

std::vector<CollapseSurface::Candidate> CollapseSurface::others(Index e) const {
  const Index a = mesh_.origin(e);
  const Index b = mesh_.target(e);
  if (sides_[at(a)] != 0 || sides_[at(b)] != 0) return {};
  const EdgeQuadric sums = quadric(e);
  const Vector3 middle = 0.5 * (places_[at(a)] + places_[at(b)]);
  std::vector<Candidate> others = {
      candidate(e, keeping(e, sums, a)), candidate(e, keeping(e, sums, b)),
      candidate(e, {.place = middle, .kept = kNone, .cost = cost_of(e, sums, middle)})};
  std::stable_sort(others.begin(), others.end(),
                   [](const Candidate& x, const Candidate& y) { return x.cost < y.cost; });
  return others;
}

bool CollapseSurface::fits(Index e, const Candidate& candidate) {
  if (!mesh_.may_collapse(e)) return false;
  const IntPoint place = {candidate.vertex.u, candidate.vertex.v};
  return each_new_triangle(e, candidate.kept, [&](Index x, Index y) {
    return orientation(place, point(x), point(y)) > 0;
  });
}

// Only what changes in the sums around is taken out and put in: to walk the neighbours' own stars would
// double the time of a run. What subtraction loses is as small as what any sum of doubles does, and
// goes when edge_collapse() begins its next round with new sums.
void CollapseSurface::add_to_ring(Index v, Index other, double factor) {
  const Vector3 here = places_[at(v)];
  const auto add_neighbour = [&](Index w) {
    if (w == other) return;
    StarSums& sums = sums_[at(w)];
    const Vector3 offset = here - places_[at(w)];
    sums.neighbours += factor * offset;
    sums.squared_distances += factor * dot(offset, offset);
    sums.degree += factor;
  };
  mesh_.each_leaving(v, [&](Index e) {
    const Index x = mesh_.target(e);
    const Index back = CollapseMesh::previous(e);
    const Index y = mesh_.origin(back);
    const Vector3 normal = cross(places_[at(x)] - here, places_[at(y)] - here);
    for (const Index w : {x, y}) {
      if (w == other) continue;
      sums_[at(w)].normals += factor * normal;
      sums_[at(w)].planes.add_outer(factor, normal);
    }
    add_neighbour(x);
    if (mesh_.on_hull(back)) add_neighbour(y);
  });
}

CollapseSurface::Index CollapseSurface::collapse(Index e, const Candidate& candidate) {
  const Index a = mesh_.origin(e);
  const Index b = mesh_.target(e);
  const Index v = candidate.kept == kNone ? a : candidate.kept;
  add_to_ring(a, b, -1);
  add_to_ring(b, a, -1);
  // The edge's own triangles were taken out twice, where they have their tips.
  const Vector3 along = places_[at(b)] - places_[at(a)];
  for (const Index h : {e, mesh_.twin(e)}) {
    if (h == kNone) continue;
    const Index tip = mesh_.origin(CollapseMesh::previous(h));
    const Vector3 normal = cross(along, places_[at(tip)] - places_[at(a)]);
    sums_[at(tip)].add_triangle(h == e ? normal : -1 * normal);
  }
  mesh_.collapse(e, v);
  vertices_[at(v)] = candidate.vertex;
  places_[at(v)] = scaled(candidate.vertex);
  update_sums(v);
  add_to_ring(v, kNone, 1);
  return v;
}

Tin CollapseSurface::tin() const {
  Tin tin;
  std::vector<std::uint32_t> number(vertices_.size(), 0);
  for (Index v = 0; v < mesh_.vertex_count(); ++v) {
    if (!mesh_.vertex_is_alive(v)) continue;
    number[at(v)] = static_cast<std::uint32_t>(tin.vertices.size());
    tin.vertices.push_back(vertices_[at(v)]);
  }
  tin.indices.reserve(3 * static_cast<std::size_t>(mesh_.triangle_count()));
  for (Index e = 0; e < mesh_.half_edge_count(); ++e) {
    if (mesh_.is_alive(e)) tin.indices.push_back(number[at(mesh_.origin(e))]);
  }
  return tin;
}

}  // namespace qmpipe
