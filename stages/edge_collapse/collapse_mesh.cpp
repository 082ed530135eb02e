#include "stages/edge_collapse/collapse_mesh.h"

#include <algorithm>

#include "scheduler/check.h"

namespace qmpipe {

CollapseMesh::CollapseMesh(std::span<const std::uint32_t> indices, std::size_t vertex_count)
    : half_edges_(indices.size()), out_(vertex_count, kNone), mark_(vertex_count, 0) {
  QMPIPE_CHECK(indices.size() % 3 == 0 && !indices.empty());
  for (Index e = 0; e < half_edge_count(); ++e) {
    QMPIPE_CHECK(indices[at(e)] < vertex_count);
    half_edges_[at(e)].origin = static_cast<Index>(indices[at(e)]);
  }
  find_twins();
  for (Index e = 0; e < half_edge_count(); ++e) {
    Index& out = out_[at(origin(e))];
    if (out == kNone || on_hull(e)) out = e;
  }
  triangle_count_ = half_edge_count() / 3;
  QMPIPE_CHECK(std::find(out_.begin(), out_.end(), kNone) == out_.end());
  std::int64_t in_fans = 0;
  for (Index v = 0; v < this->vertex_count(); ++v) {
    each_leaving(v, [&in_fans](Index /*e*/) { ++in_fans; });
  }
  QMPIPE_CHECK(in_fans == half_edge_count());
}

void CollapseMesh::find_twins() {
  // The half-edges that leave a vertex as a list: the last one found, and the one before each.
  std::vector<Index> last(out_.size(), kNone);
  std::vector<Index> before(half_edges_.size(), kNone);
  edge_count_ = half_edge_count();
  for (Index e = 0; e < half_edge_count(); ++e) {
    for (Index f = last[at(target(e))]; f != kNone; f = before[at(f)]) {
      if (target(f) != origin(e)) continue;
      QMPIPE_CHECK(on_hull(e) && on_hull(f));
      link(e, f);
      --edge_count_;
    }
    before[at(e)] = last[at(origin(e))];
    last[at(origin(e))] = e;
  }
}

void CollapseMesh::link(Index e, Index f) {
  if (e != kNone) half_edges_[at(e)].twin = f;
  if (f != kNone) half_edges_[at(f)].twin = e;
}

bool CollapseMesh::may_collapse(Index e) {
  const Index a = origin(e);
  const Index b = target(e);
  if (!on_hull(e) && vertex_on_hull(a) && vertex_on_hull(b)) return false;
  // A triangle with a second edge on the hull would leave its tip behind.
  const auto has_tip = [this](Index f) { return on_hull(next(f)) && on_hull(previous(f)); };
  if (has_tip(e) || (!on_hull(e) && has_tip(twin(e)))) return false;
  ++marks_;
  each_neighbour(a, [this](Index w) { mark_[at(w)] = marks_; });
  int common = 0;
  each_neighbour(b, [&](Index w) { common += mark_[at(w)] == marks_ ? 1 : 0; });
  return common == (on_hull(e) ? 1 : 2);
}

void CollapseMesh::close(Index e) {
  const Index right = twin(next(e));
  const Index left = twin(previous(e));
  const Index tip = origin(previous(e));
  if (out_[at(tip)] == previous(e)) out_[at(tip)] = right;
  link(right, left);
  const Index first = e - e % 3;
  for (Index k = first; k < first + 3; ++k) half_edges_[at(k)] = {};
  --triangle_count_;
}

CollapseMesh::Index CollapseMesh::after_closing(Index e, Index edge) const {
  const Index t = twin(edge);
  if (e == next(edge)) return twin(previous(edge));
  if (t != kNone && e == next(t)) return twin(previous(t));
  return e;
}

void CollapseMesh::collapse(Index e, Index kept) {
  const Index a = origin(e);
  const Index b = target(e);
  QMPIPE_ASSERT(kept == a || kept == b);
  const Index removed = kept == a ? b : a;
  const Index f = twin(e);
  // Of a vertex inside any half-edge will do that stays; on the hull it must be the one along it.
  Index out = kNone;
  if (f == kNone) {
    out = after_closing(out_[at(b)], e);
  } else if (vertex_on_hull(a) || vertex_on_hull(b)) {
    out = after_closing(out_[at(vertex_on_hull(a) ? a : b)], e);
  } else {
    out = twin(previous(e));
  }
  each_leaving(removed, [&](Index k) { half_edges_[at(k)].origin = kept; });
  out_[at(removed)] = kNone;
  close(e);
  if (f != kNone) close(f);
  out_[at(kept)] = out;
  edge_count_ -= f == kNone ? 2 : 3;
}

}  // namespace qmpipe
