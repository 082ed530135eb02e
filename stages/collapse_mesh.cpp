#include "stages/collapse_mesh.h"

#include <algorithm>

#include "scheduler/check.h"

namespace qmpipe {

CollapseMesh::CollapseMesh(std::span<const std::uint32_t> indices, std::size_t vertex_count)
    : origin_(indices.size()),
      twin_(indices.size(), kNone),
      out_(vertex_count, kNone),
      mark_(vertex_count, 0) {
  QMPIPE_CHECK(indices.size() % 3 == 0 && !indices.empty());
  // Twins are found by sorting: (lower end, higher end, half-edge).
  struct Ends {
    std::uint64_t key = 0;
    Index half_edge = kNone;
  };
  std::vector<Ends> ends(indices.size());
  for (Index e = 0; e < half_edge_count(); ++e) {
    const std::uint64_t from = indices[at(e)];
    const std::uint64_t to = indices[at(next(e))];
    QMPIPE_CHECK(from < vertex_count && from != to);
    origin_[at(e)] = static_cast<Index>(from);
    out_[at(origin(e))] = e;
    ends[at(e)] = {std::min(from, to) << 32U | std::max(from, to), e};
  }
  std::stable_sort(ends.begin(), ends.end(),
                   [](const Ends& a, const Ends& b) { return a.key < b.key; });
  edge_count_ = static_cast<std::int64_t>(ends.size());
  for (std::size_t k = 1; k < ends.size(); ++k) {
    if (ends[k].key != ends[k - 1].key) continue;
    const Index e = ends[k].half_edge;
    QMPIPE_CHECK(origin(e) != origin(ends[k - 1].half_edge));
    link(e, ends[k - 1].half_edge);
    --edge_count_;
  }
  for (Index e = 0; e < half_edge_count(); ++e) {
    if (on_hull(e)) out_[at(origin(e))] = e;
  }
  triangle_count_ = half_edge_count() / 3;
  QMPIPE_CHECK(std::find(out_.begin(), out_.end(), kNone) == out_.end());
  QMPIPE_CHECK(static_cast<std::int64_t>(vertex_count) - edge_count_ + triangle_count_ == 1);
}

void CollapseMesh::link(Index e, Index f) {
  if (e != kNone) twin_[at(e)] = f;
  if (f != kNone) twin_[at(f)] = e;
}

bool CollapseMesh::may_collapse(Index e) const {
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
  for (Index k = first; k < first + 3; ++k) {
    origin_[at(k)] = kNone;
    twin_[at(k)] = kNone;
  }
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
  each_leaving(removed, [&](Index k) { origin_[at(k)] = kept; });
  out_[at(removed)] = kNone;
  close(e);
  if (f != kNone) close(f);
  out_[at(kept)] = out;
  edge_count_ -= f == kNone ? 2 : 3;
}

}  // namespace qmpipe
