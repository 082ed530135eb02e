// From coordinates to a cleaned set of integer points: thinning, the grid, points at one place,
// outliers. For formats/ only.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <unordered_map>
#include <vector>

#include "formats/bytes/result.h"
#include "formats/points/point_cloud.h"

namespace qmpipe {

using PointPlace = std::array<double, 3>;

// Points as a file has them: coordinate = offset + step * value. Values of a LAS file are integers.
struct RawPoints {
  std::vector<PointPlace> values;
  PointPlace step = {1, 1, 1};
  PointPlace offset{};
};

// Keeps of each square the point nearest to its centre, of equals the lowest, then by x and y.
// Squares are counted from coordinate 0, so that neighbouring files have the same.
class SquareThinner {
 public:
  // `side`: in the file's units, of x and y. REQUIRES: above 0.
  SquareThinner(RawPoints& points, const std::array<double, 2>& side);
  // Adds it to the points, in place of another, or not at all; true when either went.
  bool add(const PointPlace& value);

 private:
  struct Square {
    double column;
    double row;
    friend bool operator==(const Square&, const Square&) = default;
  };
  struct HashSquare {
    std::size_t operator()(const Square& square) const;
  };
  // The place within its square, -0.5..0.5.
  std::array<double, 2> from_centre(const PointPlace& value, Square& square) const;
  bool is_better(const PointPlace& a, const PointPlace& b) const;

  RawPoints* points_;
  std::array<double, 2> side_;
  std::unordered_map<Square, std::size_t, HashSquare> kept_;
};

// Values become integers: of 10^-decimals (x and y; z), or of a coarser power of ten where the grid
// would not hold them, but of x and y not of fewer than `fewest_steps` a unit for that, of z than one.
void round_to_decimals(RawPoints& points, const std::array<int, 2>& decimals, double fewest_steps);

// Sets points, frame and counts of the cloud, whose units_m are set. An Error when the points are too
// widely spread: more than one in a thousand would not be on the grid. The raw points are used up.
std::optional<Error> put_on_grid(RawPoints raw, double outlier_m, PointCloud& cloud);

}  // namespace qmpipe
