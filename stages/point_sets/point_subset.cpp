#include "stages/point_sets/point_subset.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <random>
#include <utility>

#include "scheduler/check.h"

namespace qmpipe {
namespace {

// The covariance of points, times their number: xx, xy, xz, yy, yz, zz.
using Covariance = std::array<double, 6>;

struct PrincipalAxes {
  double variation = 0;  // smallest eigenvalue as a share of the sum
  Vec3 longest{};        // direction of the largest
};

// Jacobi's method. A rotation that takes away the element (p, q) is applied until none is felt.
PrincipalAxes principal_axes(const Covariance& c) {
  std::array<Vec3, 3> a = {{{c[0], c[1], c[2]}, {c[1], c[3], c[4]}, {c[2], c[4], c[5]}}};
  std::array<Vec3, 3> axes = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};  // columns
  constexpr int kMostSweeps = 30;
  constexpr std::array<std::array<std::size_t, 2>, 3> kPairs = {{{0, 1}, {0, 2}, {1, 2}}};
  const double trace = c[0] + c[3] + c[5];
  for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
    if (std::abs(a[0][1]) + std::abs(a[0][2]) + std::abs(a[1][2]) <= 1e-18 * trace) break;
    for (const auto& [p, q] : kPairs) {
      if (a[p][q] == 0) continue;
      const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
      const double t = std::copysign(1.0, theta) / (std::abs(theta) + std::sqrt(theta * theta + 1));
      const double cosine = 1 / std::sqrt(t * t + 1);
      const double sine = t * cosine;
      const std::size_t r = 3 - p - q;
      const double pr = a[p][r];
      const double qr = a[q][r];
      a[p][p] -= t * a[p][q];
      a[q][q] += t * a[p][q];
      a[p][q] = a[q][p] = 0;
      a[p][r] = a[r][p] = cosine * pr - sine * qr;
      a[q][r] = a[r][q] = sine * pr + cosine * qr;
      for (Vec3& row : axes) {
        const double at_p = row[p];
        row[p] = cosine * at_p - sine * row[q];
        row[q] = sine * at_p + cosine * row[q];
      }
    }
  }
  const Vec3 values = {a[0][0], a[1][1], a[2][2]};
  const auto [least, most] = std::minmax_element(values.begin(), values.end());
  const auto k = static_cast<std::size_t>(most - values.begin());
  return {.variation = trace > 0 ? std::max(0.0, *least) / trace : 0,
          .longest = {axes[0][k], axes[1][k], axes[2][k]}};
}

class Hierarchy {
 public:
  Hierarchy(std::span<const Vec3> points, std::int32_t cluster_size, double surface_variation)
      : points_(points),
        cluster_size_(static_cast<std::size_t>(cluster_size)),
        most_variation_(surface_variation),
        order_(points.size()) {
    std::iota(order_.begin(), order_.end(), 0U);
  }

  PointIndices run() {
    PointIndices kept;
    std::vector<std::span<std::uint32_t>> clusters;
    if (!order_.empty()) clusters.emplace_back(order_);
    while (!clusters.empty()) {
      const std::span<std::uint32_t> cluster = clusters.back();
      clusters.pop_back();
      const Vec3 middle = middle_of(cluster);
      const std::size_t cut = divide(cluster, middle);
      if (cut == 0 || cut == cluster.size()) {
        kept.push_back(nearest(cluster, middle));
      } else {
        clusters.push_back(cluster.first(cut));
        clusters.push_back(cluster.subspan(cut));
      }
    }
    std::sort(kept.begin(), kept.end());
    return kept;
  }

 private:
  using Cluster = std::span<const std::uint32_t>;

  Vec3 middle_of(Cluster cluster) const {
    Vec3 sum{};
    for (const std::uint32_t k : cluster) sum = plus(sum, points_[k]);
    return scaled(sum, 1 / static_cast<double>(cluster.size()));
  }

  Covariance covariance(Cluster cluster, const Vec3& middle) const {
    Covariance c{};
    for (const std::uint32_t k : cluster) {
      const Vec3 d = minus(points_[k], middle);
      c[0] += d[0] * d[0];
      c[1] += d[0] * d[1];
      c[2] += d[0] * d[2];
      c[3] += d[1] * d[1];
      c[4] += d[1] * d[2];
      c[5] += d[2] * d[2];
    }
    return c;
  }

  // Puts the points on the near side of the plane first and returns their number; 0 for a cluster
  // that stays whole.
  std::size_t divide(std::span<std::uint32_t> cluster, const Vec3& middle) const {
    if (cluster.size() == 1) return 0;
    const PrincipalAxes axes = principal_axes(covariance(cluster, middle));
    if (cluster.size() <= cluster_size_ && axes.variation <= most_variation_) return 0;
    const auto cut = std::partition(cluster.begin(), cluster.end(), [&](std::uint32_t k) {
      return dot(minus(points_[k], middle), axes.longest) < 0;
    });
    return static_cast<std::size_t>(cut - cluster.begin());
  }

  std::uint32_t nearest(Cluster cluster, const Vec3& middle) const {
    std::pair<double, std::uint32_t> best = {INFINITY, 0};
    for (const std::uint32_t k : cluster) {
      const Vec3 d = minus(points_[k], middle);
      best = std::min(best, {dot(d, d), k});
    }
    return best.second;
  }

  std::span<const Vec3> points_;
  std::size_t cluster_size_;
  double most_variation_;
  PointIndices order_;
};

}  // namespace

PointIndices random_sample(std::size_t count, std::size_t kept, std::uint64_t seed) {
  QMPIPE_CHECK(kept <= count);
  PointIndices order(count);
  std::iota(order.begin(), order.end(), 0U);
  std::mt19937_64 random(seed);
  // The standard's shuffle and distributions differ between libraries; the remainder's preference
  // for low numbers is one in 2^40 here.
  for (std::size_t k = 0; k < kept; ++k) std::swap(order[k], order[k + random() % (count - k)]);
  order.resize(kept);
  return order;
}

std::size_t share_of(std::size_t count, double percent) {
  return static_cast<std::size_t>(static_cast<double>(count) * (percent / 100));
}

PointIndices random_subset(std::size_t count, double removed_percent, std::uint64_t seed) {
  PointIndices kept = random_sample(count, share_of(count, 100 - removed_percent), seed);
  std::sort(kept.begin(), kept.end());
  return kept;
}

PointIndices grid_subset(std::span<const Vec3> points, double cell_size_m, std::uint64_t seed) {
  QMPIPE_CHECK(cell_size_m > 0);
  struct Member {
    Vec3 cell{};
    std::uint32_t rank = 0;
    std::uint32_t point = 0;
  };
  std::vector<Member> members;
  members.reserve(points.size());
  for (const std::uint32_t k : random_sample(points.size(), points.size(), seed)) {
    const auto cell = [&](std::size_t axis) { return std::floor(points[k][axis] / cell_size_m); };
    members.push_back({.cell = {cell(0), cell(1), cell(2)},
                       .rank = static_cast<std::uint32_t>(members.size()),
                       .point = k});
  }
  std::sort(members.begin(), members.end(), [](const Member& a, const Member& b) {
    return a.cell != b.cell ? a.cell < b.cell : a.rank < b.rank;
  });
  PointIndices kept;
  for (std::size_t k = 0; k < members.size(); ++k) {
    if (k == 0 || members[k].cell != members[k - 1].cell) kept.push_back(members[k].point);
  }
  std::sort(kept.begin(), kept.end());
  return kept;
}

PointIndices hierarchy_subset(std::span<const Vec3> points, std::int32_t cluster_size,
                              double surface_variation) {
  QMPIPE_CHECK(cluster_size >= 1);
  return Hierarchy(points, cluster_size, surface_variation).run();
}

}  // namespace qmpipe
