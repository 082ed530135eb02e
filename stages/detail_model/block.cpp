#include "stages/detail_model/block.h"

#include <algorithm>
#include <cmath>

namespace qmpipe {
namespace {

constexpr std::uint32_t kUnset = 0xFFFFFFFF;

std::uint32_t u32(std::size_t number) { return static_cast<std::uint32_t>(number); }
std::size_t at(CollapseMesh::Index i) { return static_cast<std::size_t>(i); }

// New numbers for the half-edges of a mesh that was simplified.
class Renumbering {
 public:
  Renumbering(std::size_t half_edges, std::span<const DetailCollapse> collapses)
      : half_edge_(half_edges, kUnset) {
    for (const DetailCollapse& collapse : collapses) {
      mark_dead(collapse.half_edge);
      mark_dead(collapse.twin);
    }
    for (std::size_t e = 0; e < half_edges; e += 3) {
      if (half_edge_[e] == kDead) continue;
      for (std::size_t k = 0; k < 3; ++k) half_edge_[e + k] = count_++;
    }
    coarse_half_edges_ = count_;
    for (std::size_t k = collapses.size(); k-- > 0;) {
      const DetailCollapse& c = collapses[k];
      // The first added triangle is (v, r, u): the half-edge from u to v is its last.
      number_from(CollapseMesh::next(c.half_edge));
      number_from(c.twin);
    }
  }

  std::uint32_t operator[](CollapseMesh::Index e) const { return half_edge_[at(e)]; }
  bool is_coarse(std::size_t e) const { return half_edge_[e] < coarse_half_edges_; }

 private:
  static constexpr std::uint32_t kDead = kUnset - 1;
  void mark_dead(CollapseMesh::Index e) {
    const std::size_t first = at(e - e % 3);
    for (std::size_t k = first; k < first + 3; ++k) half_edge_[k] = kDead;
  }
  void number_from(CollapseMesh::Index e) {
    for (int k = 0; k < 3; ++k, e = CollapseMesh::next(e)) half_edge_[at(e)] = count_++;
  }

  std::vector<std::uint32_t> half_edge_;
  std::uint32_t count_ = 0;
  std::uint32_t coarse_half_edges_ = 0;
};

// Points that stay first, then the removed ones, the last of them first.
std::vector<std::uint32_t> point_order(std::size_t points,
                                       std::span<const DetailCollapse> collapses) {
  std::vector<bool> is_removed(points, false);
  for (const DetailCollapse& collapse : collapses) is_removed[at(collapse.removed)] = true;
  std::vector<std::uint32_t> order;
  order.reserve(points);
  for (std::size_t v = 0; v < points; ++v) {
    if (!is_removed[v]) order.push_back(u32(v));
  }
  for (std::size_t k = collapses.size(); k-- > 0;) {
    const DetailCollapse& c = collapses[k];
    order.push_back(static_cast<std::uint32_t>(c.removed));
  }
  return order;
}

// Where each vertex of the finest mesh is in the coarsest.
std::vector<std::uint32_t> last_vertices(std::size_t points,
                                         std::span<const DetailCollapse> collapses) {
  std::vector<std::uint32_t> last(points);
  for (std::size_t v = 0; v < points; ++v) last[v] = u32(v);
  for (std::size_t k = collapses.size(); k-- > 0;) {
    const DetailCollapse& c = collapses[k];
    last[at(c.removed)] = last[at(c.kept)];
  }
  return last;
}

// The record's errors are those before each collapse, finest first.
std::vector<float> svo_of(const DetailRecord& record) {
  std::vector<float> svo_m;
  svo_m.reserve(record.collapses.size() + 1);
  double largest_m2 = 0;
  const auto add = [&](double error_m2) {
    largest_m2 = std::max(largest_m2, error_m2);
    svo_m.push_back(static_cast<float>(std::sqrt(largest_m2)));
  };
  for (const DetailCollapse& collapse : record.collapses) add(collapse.mean_least_error_m2);
  add(record.mean_least_error_m2);
  std::reverse(svo_m.begin(), svo_m.end());
  return svo_m;
}

}  // namespace

OrderedBlock make_detail_block(std::span<const DetailPoint> points,
                               std::span<const std::uint32_t> triangles,
                               const DetailRecord& record) {
  const Renumbering number(triangles.size(), record.collapses);
  OrderedBlock result;
  DetailBlock& block = result.block;
  result.order = point_order(points.size(), record.collapses);
  std::vector<std::uint32_t> place(points.size());
  block.points.reserve(points.size());
  for (std::size_t k = 0; k < result.order.size(); ++k) {
    place[result.order[k]] = u32(k);
    block.points.push_back(points[result.order[k]]);
  }
  const std::vector<std::uint32_t> last = last_vertices(points.size(), record.collapses);
  for (std::size_t e = 0; e < triangles.size(); ++e) {
    if (number.is_coarse(e)) block.coarse_triangles.push_back(place[last[triangles[e]]]);
  }
  block.splits.reserve(record.collapses.size());
  for (std::size_t k = record.collapses.size(); k-- > 0;) {
    const DetailCollapse& c = record.collapses[k];
    block.splits.push_back(
        {.half_edge = number[c.first_of_fan], .fan = static_cast<std::uint32_t>(c.fan)});
  }
  block.svo_m = svo_of(record);
  return result;
}

}  // namespace qmpipe
