#include "pipeline/convert/diff_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <tuple>

#include "formats/tile/oct_normal.h"
#include "scheduler/elementary.h"
#include "scheduler/tiling_scheme.h"
#include "stages/surface/geodesy.h"

namespace qmpipe {
namespace {

// Of a vertex that only one mesh has.
constexpr std::uint32_t kAlone = std::numeric_limits<std::uint32_t>::max();

std::vector<std::uint32_t> sorted_by_post(const QuantizedMesh& mesh) {
  std::vector<std::uint32_t> order(mesh.vertex_count());
  std::iota(order.begin(), order.end(), 0U);
  std::sort(order.begin(), order.end(), [&](std::uint32_t i, std::uint32_t k) {
    return std::tuple(mesh.u[i], mesh.v[i], mesh.h[i], i) <
           std::tuple(mesh.u[k], mesh.v[k], mesh.h[k], k);
  });
  return order;
}

// The vertices of two meshes that stand for the same posts. Where several share u and v, as in a
// vertical wall, they are paired from the lowest on.
struct Pairing {
  std::vector<std::array<std::uint32_t, 2>> pairs;
  // A vertex's place in `pairs`, or kAlone.
  std::array<std::vector<std::uint32_t>, 2> pair_of;

  bool is_complete() const {
    return pairs.size() == pair_of[0].size() && pairs.size() == pair_of[1].size();
  }
};

Pairing paired(const QuantizedMesh& a, const QuantizedMesh& b) {
  Pairing pairing;
  pairing.pair_of = {std::vector<std::uint32_t>(a.vertex_count(), kAlone),
                     std::vector<std::uint32_t>(b.vertex_count(), kAlone)};
  const std::vector<std::uint32_t> order_a = sorted_by_post(a);
  const std::vector<std::uint32_t> order_b = sorted_by_post(b);
  std::size_t i = 0;
  std::size_t k = 0;
  while (i < order_a.size() && k < order_b.size()) {
    const auto post_a = std::pair(a.u[order_a[i]], a.v[order_a[i]]);
    const auto post_b = std::pair(b.u[order_b[k]], b.v[order_b[k]]);
    if (post_a == post_b) {
      const auto index = static_cast<std::uint32_t>(pairing.pairs.size());
      pairing.pair_of[0][order_a[i]] = index;
      pairing.pair_of[1][order_b[k]] = index;
      pairing.pairs.push_back({order_a[i++], order_b[k++]});
    } else if (post_a < post_b) {
      ++i;
    } else {
      ++k;
    }
  }
  return pairing;
}

double height_m(const QuantizedMesh& mesh, std::uint32_t vertex) {
  const double low = mesh.header.min_height_m;
  return low + (mesh.header.max_height_m - low) * mesh.h[vertex] / kQuantizedMax;
}

// Three pairs for each triangle, its first being the smallest; sorted.
std::vector<std::array<std::uint32_t, 3>> triangles_of(const QuantizedMesh& mesh,
                                                       const std::vector<std::uint32_t>& pair_of) {
  std::vector<std::array<std::uint32_t, 3>> triangles(mesh.triangle_count());
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    auto& triangle = triangles[t];
    for (std::size_t c = 0; c < 3; ++c) triangle[c] = pair_of[mesh.indices[3 * t + c]];
    std::rotate(triangle.begin(), std::min_element(triangle.begin(), triangle.end()),
                triangle.end());
  }
  std::sort(triangles.begin(), triangles.end());
  return triangles;
}

bool has_equal_bits(const Vec3& a, const Vec3& b) {
  return std::bit_cast<std::array<std::uint64_t, 3>>(a) ==
         std::bit_cast<std::array<std::uint64_t, 3>>(b);
}

class MeshComparer {
 public:
  MeshComparer(const QuantizedMesh& a, const QuantizedMesh& b)
      : a_(a), b_(b), pairing_(paired(a, b)) {}

  MeshDifference run() {
    compare_posts();
    compare_heights();
    compare_header();
    if (pairing_.is_complete()) {
      compare_triangles();
      compare_sides();
    }
    compare_normals();
    if (a_.water_mask != b_.water_mask) say("the water mask");
    if (a_.metadata_json != b_.metadata_json) say("the metadata extension");
    return std::move(found_);
  }

 private:
  void say(std::string part) { found_.parts.push_back(std::move(part)); }

  void compare_posts() {
    if (pairing_.is_complete()) return;
    found_.posts_only_in_a = static_cast<std::int64_t>(a_.vertex_count() - pairing_.pairs.size());
    found_.posts_only_in_b = static_cast<std::int64_t>(b_.vertex_count() - pairing_.pairs.size());
    say(fmt::format("{} / {} vertices ({} posts only in A, {} only in B), {} / {} triangles",
                    a_.vertex_count(), b_.vertex_count(), found_.posts_only_in_a,
                    found_.posts_only_in_b, a_.triangle_count(), b_.triangle_count()));
  }

  void compare_heights() {
    for (const auto& [i, k] : pairing_.pairs) {
      const double distance_m = std::abs(height_m(a_, i) - height_m(b_, k));
      found_.largest_height_m = std::max(
          found_.largest_height_m,
          std::isfinite(distance_m) ? distance_m : std::numeric_limits<double>::infinity());
    }
    if (!std::isfinite(found_.largest_height_m) && has_same_heights()) found_.largest_height_m = 0;
    if (found_.largest_height_m > 0) {
      say(fmt::format("heights by up to {:.4g} m", found_.largest_height_m));
    }
  }

  // Bit for bit, for headers whose heights are no numbers.
  bool has_same_heights() const {
    const auto bits = [](float value) { return std::bit_cast<std::uint32_t>(value); };
    return bits(a_.header.min_height_m) == bits(b_.header.min_height_m) &&
           bits(a_.header.max_height_m) == bits(b_.header.max_height_m) &&
           std::all_of(pairing_.pairs.begin(), pairing_.pairs.end(),
                       [this](const auto& pair) { return a_.h[pair[0]] == b_.h[pair[1]]; });
  }

  void compare_header() {
    const QuantizedMeshHeader& a = a_.header;
    const QuantizedMeshHeader& b = b_.header;
    const auto compare_number = [this](const char* name, auto x, auto y) {
      const bool is_same = x == y || (std::isnan(x) && std::isnan(y));
      if (!is_same) say(fmt::format("the header's {} {} / {} m", name, x, y));
    };
    compare_number("lowest height", a.min_height_m, b.min_height_m);
    compare_number("highest height", a.max_height_m, b.max_height_m);
    if (!has_equal_bits(a.centre_ecef_m, b.centre_ecef_m)) {
      say(fmt::format("the header's centre by {:.4g} m",
                      length(minus(a.centre_ecef_m, b.centre_ecef_m))));
    }
    if (!has_equal_bits(a.sphere_centre_ecef_m, b.sphere_centre_ecef_m)) {
      say(fmt::format("the header's sphere centre by {:.4g} m",
                      length(minus(a.sphere_centre_ecef_m, b.sphere_centre_ecef_m))));
    }
    compare_number("sphere radius", a.sphere_radius_m, b.sphere_radius_m);
    if (!has_equal_bits(a.horizon_occlusion_point, b.horizon_occlusion_point)) {
      say("the header's horizon occlusion point");
    }
  }

  void compare_triangles() {
    const auto of_a = triangles_of(a_, pairing_.pair_of[0]);
    const auto of_b = triangles_of(b_, pairing_.pair_of[1]);
    if (of_a != of_b) {
      std::vector<std::array<std::uint32_t, 3>> shared;
      std::set_intersection(of_a.begin(), of_a.end(), of_b.begin(), of_b.end(),
                            std::back_inserter(shared));
      say(fmt::format("the triangles ({} only in A, {} only in B)", of_a.size() - shared.size(),
                      of_b.size() - shared.size()));
    } else if (a_.u != b_.u || a_.v != b_.v) {
      say("the order of the vertices");
    } else if (a_.indices != b_.indices) {
      say("the order of the indices");
    }
  }

  void compare_sides() {
    for (const Side side : kSides) {
      const auto pairs_of = [side](const QuantizedMesh& mesh,
                                   const std::vector<std::uint32_t>& pair_of) {
        std::vector<std::uint32_t> pairs;
        for (const std::uint32_t vertex : mesh.sides[index_of(side)]) {
          pairs.push_back(pair_of[vertex]);
        }
        return pairs;
      };
      if (pairs_of(a_, pairing_.pair_of[0]) != pairs_of(b_, pairing_.pair_of[1])) {
        say(fmt::format("the {} side list", name_of(side)));
      }
    }
  }

  void compare_normals() {
    if (a_.normals.empty() != b_.normals.empty()) {
      say(a_.normals.empty() ? "normals only in B" : "normals only in A");
      return;
    }
    if (a_.normals.empty()) return;
    bool is_same = true;
    for (const auto& [i, k] : pairing_.pairs) {
      if (a_.normals[i] == b_.normals[k]) continue;
      is_same = false;
      const double cosine = dot(decode_oct_normal(a_.normals[i]), decode_oct_normal(b_.normals[k]));
      const double angle_deg = atan2_deg(std::sqrt(std::max(0.0, 1 - cosine * cosine)), cosine);
      found_.largest_normal_deg = std::max(found_.largest_normal_deg, angle_deg);
    }
    if (!is_same) say(fmt::format("normals by up to {:.3g} degrees", found_.largest_normal_deg));
  }

  const QuantizedMesh& a_;
  const QuantizedMesh& b_;
  const Pairing pairing_;
  MeshDifference found_;
};

}  // namespace

MeshDifference difference_of(const QuantizedMesh& a, const QuantizedMesh& b) {
  return MeshComparer(a, b).run();
}

}  // namespace qmpipe
