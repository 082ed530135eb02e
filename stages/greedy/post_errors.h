// The vertical error of triangles at the posts that they cover: the measure of every method with a
// tolerance.
//
// Guarantees: when no post of a triangle exceeds threshold_m(), every one is within the tolerance
// of the surface that the file will decode to, whatever float arithmetic lost on the way. With
// Curvature::kCounts both the height error alone and height error plus the depth of the chord
// below the globe count. Posts within one quantized unit of the triangle are looked at too, so
// that no rounding leaves a post to neither of two triangles.
// const use is safe from several threads.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "stages/greedy/worst_post.h"
#include "stages/posts/height_step.h"
#include "stages/surface/curvature.h"
#include "stages/surface/delaunay.h"
#include "stages/surface/triangle_scan.h"

namespace qmpipe {

enum class Curvature { kCounts, kIgnored };

class PostErrors {
 public:
  struct Corner {
    IntPoint place;
    double height_m = 0;  // relative to base_m()
  };
  using Corners = std::array<Corner, 3>;

  // REQUIRES: heights_m has grid.post_count() finite heights; tolerance_m > height_steps.side_m / 2;
  // `grid` outlives this.
  PostErrors(const PostGrid& grid, std::span<const float> heights_m, double tolerance_m,
             const HeightSteps& height_steps, Curvature curvature);

  // The middle of the heights, on a step. Heights are kept relative to it: differences of floats
  // near each other lose nothing, so the error of a float sum stays far below a tolerance even in
  // the Himalayas.
  double base_m() const { return range_.middle_m; }
  float threshold_m() const { return threshold_; }
  float height_m(std::int32_t post) const { return heights_[static_cast<std::size_t>(post)]; }

  // The worst post of a counter-clockwise triangle. Rows j_first..j_last are looked at: those of
  // its lowest and highest corner, one more on each side where a corner is no post.
  Worst worst_post(const Corners& corners, std::int32_t j_first, std::int32_t j_last) const;
  // The same, but passes over posts that are blocked: those that are judged as vertices, or that
  // cannot become any. Slower; worst_post() first. REQUIRES: one flag a post.
  Worst worst_free_post(const Corners& corners, std::int32_t j_first, std::int32_t j_last,
                        std::span<const std::uint8_t> blocked) const;

 private:
  // The middle of the heights, on a step, and how far the farthest lies from it.
  struct HeightRange {
    double middle_m = 0;
    double reach_m = 0;
  };
  static HeightRange height_range(std::span<const float> heights_m, double step_m);
  // A row of a plane: the value at post i is at_first + step * i.
  struct PlaneRow {
    double at_first = 0;
    double step = 0;
    RowLine from(std::int32_t i) const {
      return {.start = static_cast<float>(at_first + step * i), .step = static_cast<float>(step)};
    }
  };
  struct TrianglePlanes {
    Plane height;
    Plane latitude_squared;
    Plane longitude_squared;
  };
  TrianglePlanes planes_of(const Corners& corners) const;
  PlaneRow height_row(const TrianglePlanes& planes, std::int32_t j) const;
  PlaneRow curved_row(const TrianglePlanes& planes, std::int32_t j) const;

  const PostGrid& grid_;
  double units_per_column_;
  HeightRange range_;
  std::vector<float> heights_;  // less base_m()
  bool curved_ = false;
  CurvatureTerms curvature_;
  std::vector<float> curved_heights_;  // heights_ plus the curvature's term
  float threshold_ = 0;
};

}  // namespace qmpipe
