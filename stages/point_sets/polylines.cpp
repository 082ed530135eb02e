#include "stages/point_sets/polylines.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <queue>

#include "scheduler/check.h"
#include "stages/surface/delaunay.h"
#include "stages/surface/metric_frame.h"

namespace qmpipe {
namespace {

double squared_distance(const Vec3& p, const Vec3& a, const Vec3& b) {
  const Vec3 ab = minus(b, a);
  const Vec3 ap = minus(p, a);
  const double squared = dot(ab, ab);
  const double along = squared > 0 ? std::clamp(dot(ap, ab) / squared, 0.0, 1.0) : 0.0;
  const Vec3 rest = minus(ap, scaled(ab, along));
  return dot(rest, rest);
}

// A set of posts, one bit each, that can be searched by rectangle.
class PostSet {
 public:
  explicit PostSet(const PostGrid& grid)
      : words_per_row_((at(grid.width_posts) + 63) / 64),
        words_(words_per_row_ * at(grid.height_posts), 0) {}

  void insert(std::int32_t i, std::int32_t j) { words_[word(i, j)] |= bit(i); }
  void erase(std::int32_t i, std::int32_t j) { words_[word(i, j)] &= ~bit(i); }

  // True when `test` (i, j) is for one of the posts of the row from i0 to i1.
  template <class Test>
  bool any_of_row(std::int32_t j, std::int32_t i0, std::int32_t i1, const Test& test) const {
    for (std::int32_t first = i0 & ~63; first <= i1; first += 64) {
      std::uint64_t bits = words_[word(first, j)];
      if (first < i0) bits &= ~std::uint64_t{0} << static_cast<unsigned>(i0 - first);
      for (; bits != 0; bits &= bits - 1) {
        const std::int32_t i = first + std::countr_zero(bits);
        if (i > i1) break;
        if (test(i, j)) return true;
      }
    }
    return false;
  }

 private:
  static std::size_t at(std::int32_t k) { return static_cast<std::size_t>(k); }
  static std::uint64_t bit(std::int32_t i) { return 1ULL << (static_cast<unsigned>(i) % 64); }
  std::size_t word(std::int32_t i, std::int32_t j) const {
    return at(j) * words_per_row_ + at(i) / 64;
  }
  std::size_t words_per_row_;
  std::vector<std::uint64_t> words_;
};

class PolylineSimplifier {
 public:
  PolylineSimplifier(const PostGrid& grid, std::span<const double> heights_m,
                     const std::vector<Polyline>& polylines, double error_m);
  void run();
  // Node by node, what is left of the polylines.
  std::vector<Polyline> result(const std::vector<Polyline>& polylines) const;

 private:
  using Index = std::uint32_t;
  // A point of a polyline; nodes of one polyline stand together, in its order.
  struct Node {
    std::int32_t post = 0;
    Index previous = 0;
    Index next = 0;
    double longest_edge = 0;
    bool removable = false;
    bool removed = false;
    std::uint32_t version = 0;
  };
  struct Candidate {
    double squared_error = 0;
    std::int32_t post = 0;
    Index node = 0;
    std::uint32_t version = 0;
  };
  struct LessUrgent {
    bool operator()(const Candidate& a, const Candidate& b) const {
      if (a.squared_error != b.squared_error) return a.squared_error > b.squared_error;
      return a.post > b.post;
    }
  };

  IntPoint place(std::int32_t post) const {
    return {grid_.u[static_cast<std::size_t>(grid_.column(post))],
            grid_.v[static_cast<std::size_t>(grid_.row(post))]};
  }
  Vec3 position(std::int32_t post) const {
    const IntPoint p = place(post);
    return {p.x * scale_.metres_per_u, p.y * scale_.metres_per_v,
            heights_m_[static_cast<std::size_t>(post)]};
  }
  void add_node(std::int32_t post, double longest_edge, bool is_first, bool is_last);
  void enqueue(Index index);
  double squared_error_without(const Node& node) const;
  bool is_edge(std::int32_t a, std::int32_t b) const;
  bool keeps_topology_without(const Node& node) const;
  void remove(Index index);

  const PostGrid& grid_;
  std::span<const double> heights_m_;
  FlatScale scale_;
  double most_squared_error_;
  std::vector<Node> nodes_;
  std::vector<std::vector<Index>> nodes_of_post_;
  PostSet vertices_;
  std::priority_queue<Candidate, std::vector<Candidate>, LessUrgent> queue_;
};

PolylineSimplifier::PolylineSimplifier(const PostGrid& grid, std::span<const double> heights_m,
                                       const std::vector<Polyline>& polylines, double error_m)
    : grid_(grid),
      heights_m_(heights_m),
      scale_(flat_scale(grid)),
      most_squared_error_(error_m * error_m),
      nodes_of_post_(grid.post_count()),
      vertices_(grid) {
  for (const Polyline& polyline : polylines) {
    QMPIPE_CHECK(polyline.posts.size() >= 2);
    for (std::size_t k = 0; k < polyline.posts.size(); ++k) {
      add_node(polyline.posts[k], polyline.longest_edge, k == 0, k + 1 == polyline.posts.size());
    }
  }
  for (Node& node : nodes_) {
    if (nodes_of_post_[static_cast<std::size_t>(node.post)].size() > 1) node.removable = false;
  }
}

void PolylineSimplifier::add_node(std::int32_t post, double longest_edge, bool is_first,
                                  bool is_last) {
  const auto index = static_cast<Index>(nodes_.size());
  nodes_.push_back({.post = post,
                    .previous = is_first ? index : index - 1,
                    .next = is_last ? index : index + 1,
                    .longest_edge = longest_edge,
                    .removable = !is_first && !is_last});
  nodes_of_post_[static_cast<std::size_t>(post)].push_back(index);
  vertices_.insert(grid_.column(post), grid_.row(post));
}

// Of all posts that have gone between the neighbours, this one included; infinite when more than
// allowed.
double PolylineSimplifier::squared_error_without(const Node& node) const {
  const IntPoint from = place(nodes_[node.previous].post);
  const IntPoint to = place(nodes_[node.next].post);
  const double across = to.x - from.x;
  const double along = to.y - from.y;
  if (std::sqrt(across * across + along * along) > node.longest_edge) {
    return std::numeric_limits<double>::infinity();
  }
  const Vec3 a = position(nodes_[node.previous].post);
  const Vec3 b = position(nodes_[node.next].post);
  double largest = 0;
  for (Index k = node.previous + 1; k < node.next; ++k) {
    largest = std::max(largest, squared_distance(position(nodes_[k].post), a, b));
    if (largest > most_squared_error_) return std::numeric_limits<double>::infinity();
  }
  return largest;
}

bool PolylineSimplifier::is_edge(std::int32_t a, std::int32_t b) const {
  const auto& nodes = nodes_of_post_[static_cast<std::size_t>(a)];
  return std::any_of(nodes.begin(), nodes.end(), [&](Index k) {
    return nodes_[nodes_[k].previous].post == b || nodes_[nodes_[k].next].post == b;
  });
}

bool PolylineSimplifier::keeps_topology_without(const Node& node) const {
  const std::array<std::int32_t, 3> posts = {nodes_[node.previous].post, node.post,
                                             nodes_[node.next].post};
  if (posts[0] == posts[2] || is_edge(posts[0], posts[2])) return false;
  const std::array<IntPoint, 3> corners = {place(posts[0]), place(posts[1]), place(posts[2])};
  // On a straight line no post can be in the way.
  const std::int64_t turn = orientation(corners[0], corners[1], corners[2]);
  if (turn == 0) return true;
  const auto [i0, i1] =
      std::minmax({grid_.column(posts[0]), grid_.column(posts[1]), grid_.column(posts[2])});
  const auto [j0, j1] =
      std::minmax({grid_.row(posts[0]), grid_.row(posts[1]), grid_.row(posts[2])});
  const auto is_inside = [&](std::int32_t i, std::int32_t j) {
    const IntPoint p = place(grid_.index(i, j));
    if (p == corners[0] || p == corners[1] || p == corners[2]) return false;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::int64_t side = orientation(corners[k], corners[(k + 1) % 3], p);
      if (side != 0 && (side > 0) != (turn > 0)) return false;
    }
    return true;
  };
  for (std::int32_t j = j0; j <= j1; ++j) {
    if (vertices_.any_of_row(j, i0, i1, is_inside)) return false;
  }
  return true;
}

void PolylineSimplifier::enqueue(Index index) {
  Node& node = nodes_[index];
  if (!node.removable) return;
  ++node.version;
  const double squared_error = squared_error_without(node);
  if (squared_error > most_squared_error_) return;
  queue_.push({squared_error, node.post, index, node.version});
}

void PolylineSimplifier::remove(Index index) {
  Node& node = nodes_[index];
  node.removed = true;
  nodes_[node.previous].next = node.next;
  nodes_[node.next].previous = node.previous;
  vertices_.erase(grid_.column(node.post), grid_.row(node.post));
  enqueue(node.previous);
  enqueue(node.next);
}

void PolylineSimplifier::run() {
  for (Index k = 0; k < nodes_.size(); ++k) enqueue(k);
  while (!queue_.empty()) {
    const Candidate best = queue_.top();
    queue_.pop();
    const Node& node = nodes_[best.node];
    if (node.removed || node.version != best.version) continue;
    if (keeps_topology_without(node)) remove(best.node);
  }
}

std::vector<Polyline> PolylineSimplifier::result(const std::vector<Polyline>& polylines) const {
  std::vector<Polyline> result;
  std::size_t first = 0;
  for (const Polyline& polyline : polylines) {
    Polyline rest{.posts = {}, .longest_edge = polyline.longest_edge};
    for (std::size_t k = first; k < first + polyline.posts.size(); ++k) {
      if (!nodes_[k].removed) rest.posts.push_back(nodes_[k].post);
    }
    first += polyline.posts.size();
    result.push_back(std::move(rest));
  }
  return result;
}

}  // namespace

std::vector<Polyline> simplify_polylines(const PostGrid& grid, std::span<const double> heights_m,
                                         const std::vector<Polyline>& polylines, double error_m) {
  QMPIPE_CHECK(heights_m.size() == grid.post_count());
  PolylineSimplifier simplifier(grid, heights_m, polylines, error_m);
  simplifier.run();
  return simplifier.result(polylines);
}

}  // namespace qmpipe
