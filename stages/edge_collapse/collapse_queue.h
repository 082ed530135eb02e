// The edges that may be collapsed, cheapest first: a heap that knows where each edge is, so that
// costs can change and edges leave.
//
// Guarantees: of equal costs the lower edge comes first, so the order depends on costs and numbers
// alone, not on the history of the heap.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

namespace qmpipe {

class CollapseQueue {
 public:
  using Index = std::int32_t;
  struct Entry {
    double cost = 0;
    Index edge = 0;
    friend bool operator<(const Entry& a, const Entry& b) {
      return a.cost != b.cost ? a.cost < b.cost : a.edge < b.edge;
    }
  };

  // For edges 0..edge_limit - 1.
  explicit CollapseQueue(Index edge_limit = 0)
      : place_(static_cast<std::size_t>(edge_limit), kOutside) {
    heap_.reserve(static_cast<std::size_t>(edge_limit) / 2 + 1);
  }

  bool empty() const { return heap_.empty(); }
  std::size_t size() const { return heap_.size(); }
  bool contains(Index edge) const { return place_[at(edge)] != kOutside; }
  // REQUIRES: !empty().
  const Entry& top() const { return heap_.front(); }

  // Puts an edge in, or gives it another cost.
  void set(Index edge, double cost) {
    std::uint32_t k = place_[at(edge)];
    if (k == kOutside) {
      k = static_cast<std::uint32_t>(heap_.size());
      heap_.emplace_back();
    }
    move_from(k, {.cost = cost, .edge = edge});
  }
  // Takes an edge out; nothing where it is not in.
  void remove(Index edge) {
    const std::uint32_t k = place_[at(edge)];
    if (k == kOutside) return;
    place_[at(edge)] = kOutside;
    const Entry last = heap_.back();
    heap_.pop_back();
    if (k < heap_.size()) move_from(k, last);
  }

 private:
  static constexpr std::uint32_t kOutside = 0xFFFFFFFF;
  // Four children fit a cache line; the heap is half as deep as a binary one.
  static constexpr std::uint32_t kChildren = 4;

  static std::size_t at(Index edge) { return static_cast<std::size_t>(edge); }
  void put(std::uint32_t k, const Entry& entry) {
    heap_[k] = entry;
    place_[at(entry.edge)] = k;
  }

  // Finds the entry its place, starting at a hole.
  void move_from(std::uint32_t k, const Entry& entry) {
    while (k > 0) {
      const std::uint32_t parent = (k - 1) / kChildren;
      if (!(entry < heap_[parent])) break;
      put(k, heap_[parent]);
      k = parent;
    }
    const auto size = static_cast<std::uint32_t>(heap_.size());
    for (;;) {
      const std::uint32_t first = kChildren * k + 1;
      if (first >= size) break;
      std::uint32_t best = first;
      for (std::uint32_t c = first + 1; c < std::min(first + kChildren, size); ++c) {
        if (heap_[c] < heap_[best]) best = c;
      }
      if (!(heap_[best] < entry)) break;
      put(k, heap_[best]);
      k = best;
    }
    put(k, entry);
  }

  std::vector<Entry> heap_;
  std::vector<std::uint32_t> place_;  // of each edge in heap_
};

}  // namespace qmpipe
