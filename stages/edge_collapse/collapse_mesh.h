// The connectivity of a triangulated surface whose edges are collapsed one by one: half-edges in
// arrays, no geometry. Edge collapse and QEM share it.
//
// Notation: triangle t has half-edges 3t, 3t+1, 3t+2; half-edge e runs from origin(e) to target(e),
// counter-clockwise, and twin(e) runs the other way in the neighbour (kNone on the hull). An edge
// goes by the lower of its half-edges. Numbers of triangles and vertices never change; those that a
// collapse removes are dead.
//
// Guarantees: what was a disk stays one while every collapse may_collapse(), and so does any surface
// without a vertex at which two parts touch. The result depends on the triangles given and the
// collapses alone.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace qmpipe {

class CollapseMesh {
 public:
  using Index = std::int32_t;
  static constexpr Index kNone = -1;

  // REQUIRES: a triangulated disk, or several, with or without holes: three vertices for each
  // triangle, counter-clockwise; each of the vertices in use, and its triangles in one fan.
  CollapseMesh(std::span<const std::uint32_t> indices, std::size_t vertex_count);

  static Index next(Index e) { return e % 3 == 2 ? e - 2 : e + 1; }
  static Index previous(Index e) { return e % 3 == 0 ? e + 2 : e - 1; }

  Index half_edge_count() const { return static_cast<Index>(half_edges_.size()); }
  Index vertex_count() const { return static_cast<Index>(out_.size()); }
  std::int64_t edge_count() const { return edge_count_; }
  std::int64_t triangle_count() const { return triangle_count_; }

  // Of a half-edge; kNone for a dead one.
  Index origin(Index e) const { return half_edges_[at(e)].origin; }
  Index target(Index e) const { return origin(next(e)); }
  Index twin(Index e) const { return half_edges_[at(e)].twin; }
  Index edge(Index e) const { return twin(e) != kNone && twin(e) < e ? twin(e) : e; }
  bool is_alive(Index e) const { return origin(e) != kNone; }
  bool on_hull(Index e) const { return twin(e) == kNone; }
  // Of a vertex.
  bool vertex_is_alive(Index v) const { return out_[at(v)] != kNone; }
  bool vertex_on_hull(Index v) const { return on_hull(out_[at(v)]); }

  // Calls each(e) for the half-edges that leave v, one for each triangle around it, counter-clockwise;
  // on the hull from its first to its last.
  template <class Each>
  void each_leaving(Index v, const Each& each) const {
    const Index first = out_[at(v)];
    Index e = first;
    do {
      each(e);
      e = twin(previous(e));
    } while (e != first && e != kNone);
  }
  // Calls each(w) for the vertices that an edge joins to v, in the same order.
  template <class Each>
  void each_neighbour(Index v, const Each& each) const {
    Index last = kNone;
    each_leaving(v, [&](Index e) {
      each(target(e));
      last = previous(e);
    });
    if (on_hull(last)) each(origin(last));
  }

  // Calls each(edge) for the edges at v.
  template <class Each>
  void each_edge(Index v, const Each& each) const {
    each_leaving(v, [&](Index e) {
      each(edge(e));
      if (on_hull(previous(e))) each(previous(e));
    });
  }

  // Whether the surface stays what it is when the edge becomes a vertex: its ends have no neighbours in common but
  // those across its triangles, and when both lie on the hull, so does it.
  bool may_collapse(Index e);
  // Merges the ends of e into one, which takes the number `kept`; the other vertex and the edge's
  // triangles die. REQUIRES: may_collapse(e); kept is one of its ends.
  void collapse(Index e, Index kept);

 private:
  static std::size_t at(Index i) { return static_cast<std::size_t>(i); }
  void find_twins();
  // Takes triangle e / 3 out and joins what its other two edges bordered on.
  void close(Index e);
  void link(Index e, Index f);
  // What leaves the same vertex as e once close() has taken the triangles of `edge` out.
  Index after_closing(Index e, Index edge) const;

  // Side by side, because walks need both.
  struct HalfEdge {
    Index origin = kNone;
    Index twin = kNone;
  };
  std::vector<HalfEdge> half_edges_;
  std::vector<Index> out_;  // a half-edge that leaves each vertex: on the hull the one along it
  std::int64_t edge_count_ = 0;
  std::int64_t triangle_count_ = 0;
  std::vector<std::uint32_t> mark_;  // of vertices; scratch of may_collapse()
  std::uint32_t marks_ = 0;
};

}  // namespace qmpipe
