// The WGS84 ellipsoid, and how long a degree is on it.
#pragma once

#include <cmath>

#include "scheduler/elementary.h"

namespace qmpipe {

inline constexpr double kEquatorialRadiusM = 6378137.0;
inline constexpr double kPolarRadiusM = 6356752.3142451793;

// Metres in one radian of longitude, apart from the latitude's cosine, and in one of latitude.
struct CurvatureRadii {
  double across_m = 0;  // in the prime vertical
  double along_m = 0;   // in the meridian
};

inline CurvatureRadii curvature_radii(double latitude_deg) {
  const double sine = sin_deg(latitude_deg);
  constexpr double kAxesRatio = kPolarRadiusM / kEquatorialRadiusM;
  constexpr double kEccentricitySquared = 1 - kAxesRatio * kAxesRatio;
  const double w = std::sqrt(1 - kEccentricitySquared * sine * sine);
  return {.across_m = kEquatorialRadiusM / w,
          .along_m = kEquatorialRadiusM * (1 - kEccentricitySquared) / (w * w * w)};
}

}  // namespace qmpipe
