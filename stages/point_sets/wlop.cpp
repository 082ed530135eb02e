#include "stages/point_sets/wlop.h"

#include <cmath>
#include <utility>

#include "scheduler/elementary.h"
#include "stages/point_sets/point_cells.h"

namespace qmpipe {
namespace {

// Nearer points count as the same one.
constexpr double kSameSquaredM = 1e-10;
constexpr double kLeastWeight = 1e-10;
constexpr double kRepulsion = 0.45;

std::vector<Vec3> positions_of(std::span<const SurfacePoint> points) {
  std::vector<Vec3> positions;
  positions.reserve(points.size());
  for (const SurfacePoint& point : points) positions.push_back(point.position);
  return positions;
}

class Wlop {
 public:
  Wlop(std::span<const SurfacePoint> points, const MetricFrame& frame, double radius_m)
      : points_(points),
        frame_(frame),
        radius_m_(radius_m),
        decay_(-4 / (radius_m * radius_m)),
        cells_(positions_of(points), radius_m) {}

  std::vector<SurfacePoint> step(std::span<const SurfacePoint> sample) const {
    const PointCells cells(positions_of(sample), radius_m_);
    // One more than the paper's, where a point is not its own neighbour: as CGAL has it.
    std::vector<double> densities;
    densities.reserve(sample.size());
    for (const SurfacePoint& point : sample) {
      double density = 1;
      cells.for_each_near(point.position, [&](std::uint32_t, double squared_m) {
        density += exponential(squared_m * decay_);
      });
      densities.push_back(density);
    }
    std::vector<SurfacePoint> moved;
    moved.reserve(sample.size());
    for (const SurfacePoint& point : sample) {
      moved.push_back(moved_point(point, sample, cells, densities));
    }
    return moved;
  }

 private:
  struct WeightedSum {
    Vec3 position{};
    double height_m = 0;
    double weight = 0;

    void add(const Vec3& at, double height, double by) {
      position = plus(position, scaled(at, by));
      height_m += height * by;
      weight += by;
    }
  };

  SurfacePoint moved_point(const SurfacePoint& point, std::span<const SurfacePoint> sample,
                           const PointCells& cells, std::span<const double> densities) const {
    WeightedSum attraction;
    cells_.for_each_near(point.position, [&](std::uint32_t k, double squared_m) {
      if (squared_m < kSameSquaredM) return;
      attraction.add(points_[k].position, points_[k].height_m, exponential(squared_m * decay_));
    });
    WeightedSum repulsion;
    int neighbours = 0;
    cells.for_each_near(point.position, [&](std::uint32_t k, double squared_m) {
      ++neighbours;
      if (squared_m < kSameSquaredM) return;
      repulsion.add(minus(point.position, sample[k].position), point.height_m - sample[k].height_m,
                    exponential(squared_m * decay_) / squared_m * densities[k]);
    });
    const bool is_drawn = attraction.weight >= kLeastWeight;
    // Itself among them: with a single other one there is no way out.
    const bool is_pushed = neighbours >= 3 && repulsion.weight >= kLeastWeight;
    if (!is_drawn && !is_pushed) return point;
    SurfacePoint result = point;
    if (is_drawn) {
      result = {.position = scaled(attraction.position, 1 / attraction.weight),
                .height_m = attraction.height_m / attraction.weight};
    }
    if (is_pushed) {
      const double by = kRepulsion / repulsion.weight;
      result.position = plus(result.position, scaled(repulsion.position, by));
      result.height_m += repulsion.height_m * by;
    }
    result.position = frame_.at_height(result.position, result.height_m);
    return result;
  }

  std::span<const SurfacePoint> points_;
  const MetricFrame& frame_;
  double radius_m_;
  double decay_;
  PointCells cells_;
};

}  // namespace

std::vector<SurfacePoint> wlop(std::span<const SurfacePoint> points,
                               std::span<const std::uint32_t> sample, const MetricFrame& frame,
                               const WlopOptions& options) {
  const Wlop method(points, frame, options.neighbour_radius_m);
  std::vector<SurfacePoint> moving;
  moving.reserve(sample.size());
  for (const std::uint32_t k : sample) moving.push_back(points[k]);
  for (std::int32_t k = 0; k < options.iterations; ++k) {
    std::vector<SurfacePoint> moved = method.step(moving);
    // Points that rest now will not move later: so it is where the radius reaches no neighbour.
    if (moved == moving) break;
    moving = std::move(moved);
  }
  return moving;
}

}  // namespace qmpipe
