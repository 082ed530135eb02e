#include "tests/support/terrain_fixture.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

namespace qmpipe::testing {
namespace {

double uniform(std::mt19937_64& random, double from, double to) {
  return from + (to - from) * (static_cast<double>(random() >> 11U) * 0x1p-53);
}

using HeightAt = std::function<double(double x, double y)>;

HeightAt hills(std::mt19937_64& random) {
  struct Wave {
    double fx, fy, phase, height_m;
  };
  std::vector<Wave> waves;
  for (int k = 1; k <= 6; ++k) {
    waves.push_back({uniform(random, -3.0 * k, 3.0 * k), uniform(random, -3.0 * k, 3.0 * k),
                     uniform(random, 0, 6.3), uniform(random, 20, 300) / k});
  }
  return [waves](double x, double y) {
    double sum = 0;
    for (const Wave& w : waves) sum += w.height_m * std::sin(w.fx * x + w.fy * y + w.phase);
    return sum;
  };
}

HeightAt cliffs(std::mt19937_64& random) {
  const HeightAt base = hills(random);
  const double angle = uniform(random, 0, 6.3);
  const double offset = uniform(random, -0.3, 0.3);
  const double drop_m = uniform(random, 50, 3000);
  return [=](double x, double y) {
    const double side = std::cos(angle) * (x - 0.5) + std::sin(angle) * (y - 0.5) - offset;
    return base(x, y) + (side > 0.05 * std::sin(9 * x) ? drop_m : 0);
  };
}

HeightAt height_at(Terrain terrain, std::mt19937_64& random) {
  const double level_m = uniform(random, -5000, 5000);
  switch (terrain) {
    case Terrain::kHills:
      return hills(random);
    case Terrain::kRidges: {
      const HeightAt base = hills(random);
      return [base](double x, double y) { return 800 - std::abs(base(x, y)); };
    }
    case Terrain::kCliffs:
      return cliffs(random);
    case Terrain::kFlat: {
      const double sx = uniform(random, -500, 500);
      const double sy = uniform(random, -500, 500);
      return [=](double x, double y) { return level_m + sx * x + sy * y; };
    }
    case Terrain::kNoise:
      return [&random](double, double) { return uniform(random, -25, 25); };
    case Terrain::kSpikes: {
      return [&random, level_m](double, double) {
        return level_m + (random() % 500 == 0 ? uniform(random, -900, 900) : 0);
      };
    }
    case Terrain::kAllEqual:
      return [level_m](double, double) { return level_m; };
    case Terrain::kSteps: {
      const HeightAt base = hills(random);
      return [base](double x, double y) { return 64 * std::round(base(x, y) / 64); };
    }
  }
  return {};
}

double cross_of(const std::array<double, 2>& a, const std::array<double, 2>& b, double u,
                double v) {
  return (b[0] - a[0]) * (v - a[1]) - (b[1] - a[1]) * (u - a[0]);
}

// Tries the posts of one triangle's bounding box and keeps the place that lies deepest inside.
void try_triangle(const PostGrid& grid, const std::array<std::array<double, 2>, 3>& c,
                  std::size_t triangle, std::vector<Place>& places, std::vector<double>& depths) {
  const auto [west, east] = std::minmax({c[0][0], c[1][0], c[2][0]});
  const auto [south, north] = std::minmax({c[0][1], c[1][1], c[2][1]});
  const double area = cross_of(c[0], c[1], c[2][0], c[2][1]);
  const auto row = std::lower_bound(grid.v_exact.begin(), grid.v_exact.end(), south - 1e-6);
  for (auto j = static_cast<std::int32_t>(row - grid.v_exact.begin()); j < kTilePosts; ++j) {
    const double v = grid.v_exact[static_cast<std::size_t>(j)];
    if (v > north + 1e-6) break;
    const auto column = std::lower_bound(grid.u_exact.begin(), grid.u_exact.end(), west - 1e-6);
    for (auto i = static_cast<std::int32_t>(column - grid.u_exact.begin()); i < kTilePosts; ++i) {
      const double u = grid.u_exact[static_cast<std::size_t>(i)];
      if (u > east + 1e-6) break;
      const double a = cross_of(c[1], c[2], u, v) / area;
      const double b = cross_of(c[2], c[0], u, v) / area;
      const double d = cross_of(c[0], c[1], u, v) / area;
      const auto post = static_cast<std::size_t>(tile_post_index(i, j));
      const double depth = std::min({a, b, d});
      if (depth <= depths[post]) continue;
      depths[post] = depth;
      places[post] = {.triangle = triangle, .weights = {a, b, d}};
    }
  }
}

}  // namespace

const char* name_of(Terrain terrain) {
  constexpr std::array kNames = {"hills", "ridges", "cliffs",    "flat",
                                 "noise", "spikes", "all equal", "steps"};
  return kNames[static_cast<std::size_t>(terrain)];
}

std::vector<float> random_terrain(Terrain terrain, std::mt19937_64& random) {
  const HeightAt height = height_at(terrain, random);
  std::vector<float> heights_m;
  heights_m.reserve(kTilePostCount);
  for (std::int32_t j = 0; j < kTilePosts; ++j) {
    for (std::int32_t i = 0; i < kTilePosts; ++i) {
      heights_m.push_back(static_cast<float>(height(i / 256.0, j / 256.0)));
    }
  }
  return heights_m;
}

double post_noise(std::uint64_t seed, std::int64_t i, std::int64_t j) {
  std::uint64_t h = seed * 0x9E3779B97F4A7C15ULL ^ static_cast<std::uint32_t>(i) ^
                    static_cast<std::uint64_t>(static_cast<std::uint32_t>(j)) << 32U;
  for (int k = 0; k < 2; ++k) h = (h ^ h >> 31U) * 0xBF58476D1CE4E5B9ULL;
  return static_cast<double>((h ^ h >> 29U) >> 11U) * 0x1p-53;
}

float globe_height_m(std::uint64_t seed, const Lattice& lattice, std::int64_t i, std::int64_t j) {
  const std::int64_t column = lattice.wrap_column(i);
  const double lon = lattice.longitude_deg(column) / 57.29577951308232;
  const double lat = lattice.latitude_deg(j) / 57.29577951308232;
  const double smooth = 1000 * std::sin(3 * lon + static_cast<double>(seed)) * std::cos(5 * lat) +
                        200 * std::sin(40 * lon) * std::sin(37 * lat);
  return static_cast<float>(smooth + 50 * post_noise(seed, column, j));
}

BorderMask random_border(std::mt19937_64& random, double probability) {
  BorderMask mask;
  mask.set(0);
  mask.set(kTileIntervals);
  for (std::int32_t k = 1; k < kTileIntervals; ++k) {
    if (uniform(random, 0, 1) < probability) mask.set(k);
  }
  return mask;
}

FixedBorders random_borders(std::mt19937_64& random, unsigned sides) {
  constexpr std::array kProbabilities = {0.0, 0.02, 0.3, 1.0};
  FixedBorders fixed;
  for (const Side side : kSides) {
    const double probability = kProbabilities[random() % kProbabilities.size()];
    if ((sides >> index_of(side) & 1U) != 0) {
      fixed[index_of(side)] = random_border(random, probability);
    }
  }
  return fixed;
}

std::vector<Place> locate_posts_slowly(const PostGrid& grid,
                                       std::span<const std::array<double, 2>> corners,
                                       std::span<const std::uint32_t> indices) {
  std::vector<Place> places(kTilePostCount);
  std::vector<double> depths(kTilePostCount, -std::numeric_limits<double>::infinity());
  for (std::size_t t = 0; 3 * t < indices.size(); ++t) {
    try_triangle(
        grid, {corners[indices[3 * t]], corners[indices[3 * t + 1]], corners[indices[3 * t + 2]]},
        t, places, depths);
  }
  return places;
}

std::vector<std::array<double, 2>> corners_of(const Tin& tin) {
  std::vector<std::array<double, 2>> corners;
  corners.reserve(tin.vertices.size());
  for (const TinVertex& vertex : tin.vertices) {
    corners.push_back({static_cast<double>(vertex.u), static_cast<double>(vertex.v)});
  }
  return corners;
}

std::string fault_of(const PostGrid& grid, const Tin& tin) {
  const auto corners = corners_of(tin);
  const double east = grid.u.back();
  const double north = grid.v.back();
  auto sorted = corners;
  std::sort(sorted.begin(), sorted.end());
  if (std::adjacent_find(sorted.begin(), sorted.end()) != sorted.end()) return "a vertex twice";
  for (const std::array<double, 2> corner :
       {std::array{0.0, 0.0}, {east, 0.0}, {0.0, north}, {east, north}}) {
    if (!std::binary_search(sorted.begin(), sorted.end(), corner)) return "a corner is missing";
  }
  for (const TinVertex& vertex : tin.vertices) {
    const bool on_side =
        vertex.u == 0 || vertex.v == 0 || vertex.u == grid.u.back() || vertex.v == grid.v.back();
    if (on_side && vertex.post == kNoPost) return "a vertex on a side that is no post";
    if (vertex.post != kNoPost &&
        (grid.u[static_cast<std::size_t>(grid.column(vertex.post))] != vertex.u ||
         grid.v[static_cast<std::size_t>(grid.row(vertex.post))] != vertex.v)) {
      return "a vertex away from its post";
    }
  }
  if (tin.indices.empty() || tin.indices.size() % 3 != 0) return "broken triangles";
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  std::vector<bool> used(tin.vertices.size(), false);
  double area = 0;
  for (std::size_t t = 0; t < tin.indices.size(); t += 3) {
    const std::array<std::uint32_t, 3> k = {tin.indices[t], tin.indices[t + 1], tin.indices[t + 2]};
    if (std::max({k[0], k[1], k[2]}) >= tin.vertices.size()) return "an index without a vertex";
    const double twice = cross_of(corners[k[0]], corners[k[1]], corners[k[2]][0], corners[k[2]][1]);
    if (twice <= 0) return "a triangle that is not counter-clockwise";
    area += twice;
    for (std::size_t c = 0; c < 3; ++c) {
      used[k[c]] = true;
      if (++edges[{k[c], k[(c + 1) % 3]}] > 1) return "an edge of two triangles on one side";
    }
  }
  if (std::find(used.begin(), used.end(), false) != used.end()) return "a vertex without triangles";
  if (area != 2.0 * east * north) return "the rectangle is not covered once";
  for (const auto& [edge, count] : edges) {
    if (edges.count({edge.second, edge.first}) != 0) continue;
    const auto& a = corners[edge.first];
    const auto& b = corners[edge.second];
    const bool on_side = (a[0] == b[0] && (a[0] == 0 || a[0] == east)) ||
                         (a[1] == b[1] && (a[1] == 0 || a[1] == north));
    if (!on_side) return "an edge inside with one triangle";
  }
  return "";
}

double largest_error_m(const PostGrid& grid, const Tin& tin, std::span<const float> heights_m,
                       const FixedBorders& fixed) {
  const auto places = locate_posts_slowly(grid, corners_of(tin), tin.indices);
  std::vector<bool> judged(kTilePostCount, true);
  for (const TinVertex& vertex : tin.vertices) {
    if (vertex.post != kNoPost) judged[static_cast<std::size_t>(vertex.post)] = false;
  }
  for (const Side side : kSides) {
    for (std::int32_t k = 0; k < kTilePosts && fixed[index_of(side)]; ++k) {
      const Post p = side_post(side, k);
      judged[static_cast<std::size_t>(tile_post_index(p.i, p.j))] = false;
    }
  }
  double largest = 0;
  for (std::size_t k = 0; k < kTilePostCount; ++k) {
    if (!judged[k]) continue;
    double surface = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      surface +=
          places[k].weights[c] * tin.vertices[tin.indices[3 * places[k].triangle + c]].height_m;
    }
    largest = std::max(largest, std::abs(surface - static_cast<double>(heights_m[k])));
  }
  return largest;
}

}  // namespace qmpipe::testing
