#include "stages/surface/delaunay.h"

#include "scheduler/check.h"

namespace qmpipe {

bool in_circle(const IntPoint& a, const IntPoint& b, const IntPoint& c, const IntPoint& d) {
  const std::int64_t ax = a.x - d.x;
  const std::int64_t ay = a.y - d.y;
  const std::int64_t bx = b.x - d.x;
  const std::int64_t by = b.y - d.y;
  const std::int64_t cx = c.x - d.x;
  const std::int64_t cy = c.y - d.y;
  return (ax * ax + ay * ay) * (bx * cy - by * cx) + (bx * bx + by * by) * (cx * ay - cy * ax) +
             (cx * cx + cy * cy) * (ax * by - ay * bx) >
         0;
}

Delaunay::Delaunay(const IntPoint& size, std::size_t expected_vertices) {
  QMPIPE_CHECK(size.x >= 1 && size.x <= 32767 && size.y >= 1 && size.y <= 32767);
  points_.reserve(expected_vertices);
  origin_.reserve(6 * expected_vertices);
  twin_.reserve(6 * expected_vertices);
  stamp_.reserve(2 * expected_vertices);
  points_ = {{0, 0}, {size.x, 0}, size, {0, size.y}};
  const Index lower = add_triangle(0, 1, 2);
  const Index upper = add_triangle(0, 2, 3);
  link(3 * lower + 2, 3 * upper);
}

Delaunay::Index Delaunay::insert(const IntPoint& point, Index near) {
  touched_.clear();
  ++insertion_;
  const Index t = locate(point, near);
  Index on_edge = kNone;
  for (Index e = 3 * t; e < 3 * t + 3; ++e) {
    if (origin_point(e) == point) return origin_[at(e)];
    if (orientation(origin_point(e), origin_point(next(e)), point) == 0) on_edge = e;
  }
  points_.push_back(point);
  const Index p = vertex_count() - 1;
  if (on_edge == kNone) {
    split_triangle(t, p);
  } else {
    split_edge(on_edge, p);
  }
  legalize();
  return p;
}

Delaunay::Index Delaunay::locate(const IntPoint& point, Index near) const {
  QMPIPE_ASSERT(near >= 0 && near < triangle_count());
  // Walks in Delaunay triangulations do not cycle; the bound only turns a bug into an error.
  Index t = near;
  for (Index steps = 0; steps <= triangle_count(); ++steps) {
    Index leave = kNone;
    for (Index e = 3 * t; e < 3 * t + 3; ++e) {
      if (orientation(origin_point(e), origin_point(next(e)), point) < 0) {
        leave = e;
        break;
      }
    }
    if (leave == kNone) return t;
    QMPIPE_CHECK(twin_[at(leave)] != kNone);  // else the point lies outside the square
    t = twin_[at(leave)] / 3;
  }
  QMPIPE_CHECK(false);
  return kNone;
}

Delaunay::Index Delaunay::add_triangle(Index a, Index b, Index c) {
  const Index t = triangle_count();
  origin_.insert(origin_.end(), {a, b, c});
  twin_.insert(twin_.end(), {kNone, kNone, kNone});
  stamp_.push_back(insertion_ - 1);
  touch(t);
  return t;
}

void Delaunay::set_triangle(Index t, Index a, Index b, Index c) {
  origin_[at(3 * t)] = a;
  origin_[at(3 * t + 1)] = b;
  origin_[at(3 * t + 2)] = c;
  touch(t);
}

void Delaunay::link(Index e, Index f) {
  if (e != kNone) twin_[at(e)] = f;
  if (f != kNone) twin_[at(f)] = e;
}

void Delaunay::touch(Index t) {
  if (stamp_[at(t)] == insertion_) return;
  stamp_[at(t)] = insertion_;
  touched_.push_back(t);
}

// Both splits make triangles (x, y, p) with the new point last, so that half-edge 3t is opposite it.
void Delaunay::split_triangle(Index t, Index p) {
  const Index a = origin_[at(3 * t)];
  const Index b = origin_[at(3 * t + 1)];
  const Index c = origin_[at(3 * t + 2)];
  const Index twin_bc = twin_[at(3 * t + 1)];
  const Index twin_ca = twin_[at(3 * t + 2)];
  set_triangle(t, a, b, p);
  const Index t1 = add_triangle(b, c, p);
  const Index t2 = add_triangle(c, a, p);
  link(3 * t1, twin_bc);
  link(3 * t2, twin_ca);
  link(3 * t + 1, 3 * t1 + 2);
  link(3 * t1 + 1, 3 * t2 + 2);
  link(3 * t2 + 1, 3 * t + 2);
  pending_ = {3 * t, 3 * t1, 3 * t2};
}

void Delaunay::split_edge(Index e, Index p) {
  // e runs a -> b in triangle (a, b, c); its twin runs b -> a in (b, a, d).
  const Index t = e / 3;
  const Index a = origin_[at(e)];
  const Index b = origin_[at(next(e))];
  const Index c = origin_[at(previous(e))];
  const Index twin_bc = twin_[at(next(e))];
  const Index twin_ca = twin_[at(previous(e))];
  const Index f = twin_[at(e)];
  Index d = kNone;
  Index twin_ad = kNone;
  Index twin_db = kNone;
  if (f != kNone) {
    d = origin_[at(previous(f))];
    twin_ad = twin_[at(next(f))];
    twin_db = twin_[at(previous(f))];
  }
  set_triangle(t, b, c, p);
  const Index t1 = add_triangle(c, a, p);
  link(3 * t, twin_bc);
  link(3 * t1, twin_ca);
  link(3 * t + 1, 3 * t1 + 2);
  pending_ = {3 * t, 3 * t1};
  if (f == kNone) {
    twin_[at(3 * t + 2)] = kNone;
    twin_[at(3 * t1 + 1)] = kNone;
    return;
  }
  const Index s = f / 3;
  set_triangle(s, a, d, p);
  const Index s1 = add_triangle(d, b, p);
  link(3 * s, twin_ad);
  link(3 * s1, twin_db);
  link(3 * s + 1, 3 * s1 + 2);
  link(3 * s + 2, 3 * t1 + 1);
  link(3 * s1 + 1, 3 * t + 2);
  pending_.push_back(3 * s);
  pending_.push_back(3 * s1);
}

void Delaunay::legalize() {
  while (!pending_.empty()) {
    const Index e = pending_.back();
    pending_.pop_back();
    const Index f = twin_[at(e)];
    if (f == kNone) continue;
    if (in_circle(origin_point(e), origin_point(next(e)), origin_point(previous(e)),
                  origin_point(previous(f)))) {
      flip(e);
    }
  }
}

// e runs a -> b in (a, b, p), its twin in (b, a, q); afterwards (a, q, p) and (q, b, p).
void Delaunay::flip(Index e) {
  const Index f = twin_[at(e)];
  const Index a = origin_[at(e)];
  const Index b = origin_[at(f)];
  const Index p = origin_[at(previous(e))];
  const Index q = origin_[at(previous(f))];
  const Index twin_bp = twin_[at(next(e))];
  const Index twin_pa = twin_[at(previous(e))];
  const Index twin_aq = twin_[at(next(f))];
  const Index twin_qb = twin_[at(previous(f))];
  const Index t = e / 3;
  const Index s = f / 3;
  set_triangle(t, a, q, p);
  set_triangle(s, q, b, p);
  link(3 * t, twin_aq);
  link(3 * t + 1, 3 * s + 2);
  link(3 * t + 2, twin_pa);
  link(3 * s, twin_qb);
  link(3 * s + 1, twin_bp);
  pending_.push_back(3 * t);
  pending_.push_back(3 * s);
}

}  // namespace qmpipe
