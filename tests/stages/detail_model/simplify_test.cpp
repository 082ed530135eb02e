#include "stages/detail_model/simplify.h"

#include <gtest/gtest.h>

#include <array>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <utility>

#include "tests/support/detail_fixture.h"

namespace qmpipe::simplify_test {
namespace {

using testing::DetailMesh;
using testing::hilly_mesh;

using Triangle = std::array<std::uint32_t, 3>;
using Long = long double;

// The same simplification without queues, half-edges or stored quadrics: every error is summed up anew
// from all planes that a vertex has gathered.
class PlainSimplifier {
 public:
  PlainSimplifier(const DetailMesh& mesh, const DetailFrame& frame) : mesh_(mesh) {
    for (std::size_t k = 0; k < mesh.triangles.size(); k += 3) {
      triangles_.push_back({mesh.triangles[k], mesh.triangles[k + 1], mesh.triangles[k + 2]});
    }
    for (const DetailPoint& point : mesh.points) places_.push_back(frame.place(point));
    planes_.resize(mesh.points.size());
    std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
    for (const Triangle& t : triangles_) {
      const std::array<Long, 4> plane = plane_of(t);
      for (std::size_t k = 0; k < 3; ++k) {
        planes_[t[k]].push_back(plane);
        ++edges[std::minmax(t[k], t[(k + 1) % 3])];
      }
    }
    for (const auto& [ends, count] : edges) {
      if (count == 1) rim_.insert({ends.first, ends.second});
    }
  }

  struct Move {
    std::uint32_t from = 0;
    std::uint32_t to = 0;
    Long error = std::numeric_limits<Long>::infinity();
  };

  // The best sound move, and the mean of all vertices' best ones.
  Move best(Long& mean) const {
    Move best;
    Long sum = 0;
    int count = 0;
    for (std::uint32_t u = 0; u < places_.size(); ++u) {
      if (rim_.contains(u)) continue;
      Move own;
      for (const std::uint32_t v : neighbours(u)) {
        const Long error = error_at(u, v) + error_at(v, v);
        if (error < own.error && is_sound(u, v)) own = {.from = u, .to = v, .error = error};
      }
      if (own.error == std::numeric_limits<Long>::infinity()) continue;
      sum += own.error;
      ++count;
      if (own.error < best.error) best = own;
    }
    mean = count > 0 ? sum / count : 0;
    return best;
  }

  void apply(const Move& move) {
    std::vector<Triangle> left;
    for (Triangle t : triangles_) {
      for (std::uint32_t& v : t) v = v == move.from ? move.to : v;
      if (t[0] != t[1] && t[1] != t[2] && t[2] != t[0]) left.push_back(t);
    }
    triangles_ = left;
    planes_[move.to].insert(planes_[move.to].end(), planes_[move.from].begin(),
                            planes_[move.from].end());
  }

  std::size_t triangle_count() const { return triangles_.size(); }

 private:
  std::array<Long, 4> plane_of(const Triangle& t) const {
    const auto& p = places_[t[0]];
    const auto& q = places_[t[1]];
    const auto& r = places_[t[2]];
    const std::array<Long, 3> u = {Long{q[0]} - p[0], Long{q[1]} - p[1], Long{q[2]} - p[2]};
    const std::array<Long, 3> v = {Long{r[0]} - p[0], Long{r[1]} - p[1], Long{r[2]} - p[2]};
    std::array<Long, 4> n = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                             u[0] * v[1] - u[1] * v[0], 0};
    const Long length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (std::size_t k = 0; k < 3; ++k) n[k] /= length;
    n[3] = -(n[0] * p[0] + n[1] * p[1] + n[2] * p[2]);
    return n;
  }
  // Of the planes of `of` at the place of `place`.
  Long error_at(std::uint32_t of, std::uint32_t place) const {
    const auto& p = places_[place];
    Long sum = 0;
    for (const auto& n : planes_[of]) {
      const Long distance = n[0] * p[0] + n[1] * p[1] + n[2] * p[2] + n[3];
      sum += distance * distance;
    }
    return sum;
  }
  std::set<std::uint32_t> neighbours(std::uint32_t u) const {
    std::set<std::uint32_t> found;
    for (const Triangle& t : triangles_) {
      if (t[0] != u && t[1] != u && t[2] != u) continue;
      found.insert(t.begin(), t.end());
    }
    found.erase(u);
    return found;
  }
  bool is_sound(std::uint32_t u, std::uint32_t v) const {
    const std::set<std::uint32_t> of_u = neighbours(u);
    const std::set<std::uint32_t> of_v = neighbours(v);
    int common = 0;
    for (const std::uint32_t w : of_u) common += of_v.contains(w) ? 1 : 0;
    if (common != 2) return false;
    for (Triangle t : triangles_) {
      const bool has_u = t[0] == u || t[1] == u || t[2] == u;
      if (!has_u || t[0] == v || t[1] == v || t[2] == v) continue;
      for (std::uint32_t& w : t) w = w == u ? v : w;
      if (plane_orientation(mesh_.points[t[0]], mesh_.points[t[1]], mesh_.points[t[2]]) <= 0) {
        return false;
      }
    }
    return true;
  }

  const DetailMesh& mesh_;
  std::vector<Triangle> triangles_;
  std::vector<std::array<double, 3>> places_;
  std::vector<std::vector<std::array<Long, 4>>> planes_;
  std::set<std::uint32_t> rim_;
};

TEST(DetailSimplify, CollapsesWhatAPlainReckoningCollapses) {
  const DetailFrame frame = {.offset = {5e5, 4e6, 100}, .step_m = {1, 1, 0.5}};
  for (const std::uint32_t seed : {1U, 2U, 3U, 4U}) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const DetailMesh mesh = hilly_mesh(9, 8, seed);
    const DetailRecord record = simplify_by_quadrics(mesh.points, mesh.triangles, frame, 40);
    PlainSimplifier plain(mesh, frame);
    ASSERT_GT(record.collapses.size(), 20U);
    for (const DetailCollapse& collapse : record.collapses) {
      Long mean = 0;
      const PlainSimplifier::Move move = plain.best(mean);
      ASSERT_EQ(move.from, static_cast<std::uint32_t>(collapse.removed));
      ASSERT_EQ(move.to, static_cast<std::uint32_t>(collapse.kept));
      // Vertices that nothing has tried to move yet count with targets that may turn out unsound.
      ASSERT_LE(collapse.mean_least_error_m2, static_cast<double>(mean) * (1 + 1e-9));
      plain.apply(move);
    }
    EXPECT_LE(plain.triangle_count(), 40U);
  }
}

TEST(DetailSimplify, AFlatSurfaceLosesAllItsInsideWithoutError) {
  DetailMesh mesh = hilly_mesh(12, 12, 5);
  for (DetailPoint& point : mesh.points) point.z = 7;
  const DetailRecord record = simplify_by_quadrics(mesh.points, mesh.triangles, {}, 0);
  EXPECT_EQ(record.collapses.size(), 100U);
  for (const DetailCollapse& collapse : record.collapses) {
    EXPECT_LT(collapse.mean_least_error_m2, 1e-18);
  }
}

TEST(DetailSimplify, EndsAtTheTargetOrWhereNoVertexMayGo) {
  const DetailMesh mesh = hilly_mesh(20, 20, 6);
  const auto triangles = static_cast<std::int64_t>(mesh.triangles.size() / 3);
  const auto left_after = [&](std::int64_t target) {
    const DetailRecord record = simplify_by_quadrics(mesh.points, mesh.triangles, {}, target);
    return triangles - 2 * static_cast<std::int64_t>(record.collapses.size());
  };
  EXPECT_EQ(left_after(triangles), triangles);
  EXPECT_EQ(left_after(300), 300);
  EXPECT_EQ(left_after(301), 300);
  // 76 vertices on the rim: a polygon of them has 74 triangles.
  EXPECT_GE(left_after(0), 74);
}

TEST(DetailSimplify, SharpFeaturesStayLongerThanSmoothOnes) {
  // A ridge along the middle of a slope.
  DetailMesh mesh = hilly_mesh(21, 21, 7);
  for (std::size_t k = 0; k < mesh.points.size(); ++k) {
    const auto i = static_cast<std::int32_t>(k % 21);
    const auto j = static_cast<std::int32_t>(k / 21);
    mesh.points[k] = {.x = 10 * i, .y = 10 * j, .z = -8 * std::abs(i - 10) + j};
  }
  const DetailRecord record = simplify_by_quadrics(mesh.points, mesh.triangles, {}, 200);
  int off_ridge = 0;
  for (const DetailCollapse& collapse : record.collapses) {
    const DetailPoint& from = mesh.points[static_cast<std::size_t>(collapse.removed)];
    const DetailPoint& to = mesh.points[static_cast<std::size_t>(collapse.kept)];
    // From the ridge only along it.
    if (from.x == 100) {
      EXPECT_EQ(to.x, 100);
    }
    off_ridge += from.x != 100 ? 1 : 0;
  }
  EXPECT_GT(off_ridge, 250);
}

}  // namespace
}  // namespace qmpipe::simplify_test
