// Posts in metres: where distances between points in space are taken (Campos et al. 2020, section
// 4.4.1).
//
// On the globe positions are ECEF; on a plane they are (east, north, height) from the south-west
// corner. The grid must outlive the frame. const use is safe from several threads.
#pragma once

#include "stages/posts/post_grid.h"
#include "stages/surface/geodesy.h"

namespace qmpipe {

class MetricFrame {
 public:
  explicit MetricFrame(const PostGrid& grid);

  // The post's exact place, at the given height.
  Vec3 position(std::int32_t post, double height_m) const;
  // The point straight above or below `position` at this height.
  Vec3 at_height(const Vec3& position, double height_m) const;

  // Places in the quantized frame. Beyond the grid they lie outside its rectangle; on the globe
  // the way round is the shorter one from the grid's middle meridian.
  struct Place {
    double u = 0;
    double v = 0;
  };
  Place place_of(const Vec3& position) const;

 private:
  const PostGrid& grid_;
};

// The metres of one unit of u and of v in the middle of the grid, for measures that take it as flat:
// on the globe those of a sphere.
struct FlatScale {
  double metres_per_u = 0;
  double metres_per_v = 0;
};
FlatScale flat_scale(const PostGrid& grid);

}  // namespace qmpipe
