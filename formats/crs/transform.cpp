#include "formats/crs/transform.h"

#include <proj.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <type_traits>
#include <utility>

#include "formats/bytes/errors.h"
#include "formats/bytes/free_with.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

using Context = std::unique_ptr<PJ_CONTEXT, FreeWith<proj_context_destroy>>;
using Object = std::unique_ptr<PJ, FreeWith<proj_destroy>>;
using ObjectList = std::unique_ptr<PJ_OBJ_LIST, FreeWith<proj_list_destroy>>;
using Factory =
    std::unique_ptr<PJ_OPERATION_FACTORY_CONTEXT, FreeWith<proj_operation_factory_context_destroy>>;

bool is_finite(const PJ_COORD& c) { return std::isfinite(c.v[0]) && std::isfinite(c.v[1]); }

constexpr int kLongitudes = 24;
// So that none is where x jumps, half a turn from somebody's central meridian.
constexpr double kFirstStep = 0.3713;
constexpr std::array<double, 4> kParallelsOfTurn = {-0.16, -0.05, 0.05, 0.16};
// Of a turn: x of one longitude on different parallels, and the steps between longitudes.
constexpr double kSameX = 1e-10;

// Which of a geographic CRS's two axes counts longitude, and what a full circle is on it.
struct LongitudeAxis {
  int index = 0;
  double circle = 360;
};

std::optional<LongitudeAxis> longitude_axis(PJ_CONTEXT* context, PJ* geographic) {
  const Object system(proj_crs_get_coordinate_system(context, geographic));
  if (!system) return std::nullopt;
  for (int axis = 0; axis < 2; ++axis) {
    const char* direction = nullptr;
    double radians = 0;
    if (proj_cs_get_axis_info(context, system.get(), axis, nullptr, nullptr, &direction, &radians,
                              nullptr, nullptr, nullptr) == 0) {
      return std::nullopt;
    }
    if (direction != nullptr && std::string(direction) == "east" && radians > 0) {
      return LongitudeAxis{.index = axis, .circle = 2 * std::numbers::pi / radians};
    }
  }
  return std::nullopt;
}

// Degrees east of west to east; narrower than the list may suggest when it crosses the
// antimeridian.
struct Area {
  double west = 0;
  double south = 0;
  double east = 0;
  double north = 0;
};

// Equal steps from longitude to longitude, all within one turn: 0 where they are not equal.
double turn_of_steps(const std::array<double, kLongitudes>& x) {
  const auto [low, high] = std::minmax_element(x.begin(), x.end());
  const double turn = (*high - *low) * kLongitudes / (kLongitudes - 1);
  for (std::size_t k = 0; k < x.size(); ++k) {
    const double step = std::abs(x[(k + 1) % x.size()] - x[k]);
    const double at_seam = turn - step;
    if (std::abs(std::min(step, at_seam) - turn / kLongitudes) > kSameX * turn) return 0;
  }
  return turn;
}

// PROJ's depend on the processor. What is left is micrometres of the Earth's equator.
double without_last_bits(double length) {
  int exponent = 0;
  constexpr int kBits = 44;
  const double fraction = std::frexp(length, &exponent);
  return std::ldexp(std::round(std::ldexp(fraction, kBits)), exponent - kBits);
}

// x is that of the first parallel's, and y the same for all longitudes.
bool goes_round(const std::array<MapPoint, kLongitudes>& row,
                const std::array<double, kLongitudes>& first_x, double turn) {
  for (std::size_t k = 0; k < row.size(); ++k) {
    if (std::abs(row[k].x - first_x[k]) > kSameX * turn) return false;
    if (std::abs(row[k].y - row[0].y) > kSameX * turn) return false;
  }
  return true;
}

}  // namespace

struct CrsTransform::Impl {
  Context context;
  Object operation;
  std::array<int, 2> axes = {1, 2};
  std::string name;

  MapPoint from_crs_axes(const PJ_COORD& c) const {
    return {.x = along(c, axes[0]), .y = along(c, axes[1])};
  }
  PJ_COORD to_crs_axes(const MapPoint& p) const {
    PJ_COORD c = proj_coord(0, 0, 0, 0);
    c.v[std::abs(axes[0]) - 1] = axes[0] < 0 ? -p.x : p.x;
    c.v[std::abs(axes[1]) - 1] = axes[1] < 0 ? -p.y : p.y;
    return c;
  }
  static double along(const PJ_COORD& c, int axis) {
    const double value = c.v[std::abs(axis) - 1];
    return axis < 0 ? -value : value;
  }

  std::optional<LonLat> inverse_by(PJ* by, const MapPoint& point) const {
    const PJ_COORD c = proj_trans(by, PJ_INV, to_crs_axes(point));
    if (!is_finite(c)) {
      proj_errno_reset(by);
      return std::nullopt;
    }
    return LonLat{.longitude_deg = c.v[1], .latitude_deg = c.v[0]};
  }

  // The candidate that reaches most of the extent; the best-ranked of equals.
  std::size_t choose(const Object& globe, const Object& crs, std::span<const MapPoint> extent,
                     const std::optional<Area>& area);
  std::optional<Area> area_of(std::span<const MapPoint> extent) const;
};

std::size_t CrsTransform::Impl::choose(const Object& globe, const Object& crs,
                                       std::span<const MapPoint> extent,
                                       const std::optional<Area>& area) {
  const Factory factory(proj_create_operation_factory_context(context.get(), nullptr));
  proj_operation_factory_context_set_spatial_criterion(context.get(), factory.get(),
                                                       PROJ_SPATIAL_CRITERION_PARTIAL_INTERSECTION);
  proj_operation_factory_context_set_grid_availability_use(
      context.get(), factory.get(), PROJ_GRID_AVAILABILITY_DISCARD_OPERATION_IF_MISSING_GRID);
  if (area) {
    proj_operation_factory_context_set_area_of_interest(context.get(), factory.get(), area->west,
                                                        area->south, area->east, area->north);
  }
  const ObjectList candidates(
      proj_create_operations(context.get(), globe.get(), crs.get(), factory.get()));
  const int count = candidates ? proj_list_get_count(candidates.get()) : 0;
  std::size_t most = 0;
  for (int k = 0; k < count && most < extent.size(); ++k) {
    Object candidate(proj_list_get(context.get(), candidates.get(), k));
    if (!candidate) continue;
    const auto reached = static_cast<std::size_t>(std::count_if(
        extent.begin(), extent.end(),
        [&](const MapPoint& point) { return inverse_by(candidate.get(), point).has_value(); }));
    if (reached <= most) continue;
    most = reached;
    operation = std::move(candidate);
  }
  return most;
}

std::optional<Area> CrsTransform::Impl::area_of(std::span<const MapPoint> extent) const {
  std::optional<Area> area;
  for (const MapPoint& point : extent) {
    const std::optional<LonLat> at = inverse_by(operation.get(), point);
    if (!at || std::abs(at->latitude_deg) > 90 || std::abs(at->longitude_deg) > 180) continue;
    if (!area) {
      area = Area{at->longitude_deg, at->latitude_deg, at->longitude_deg, at->latitude_deg};
    }
    area->west = std::min(area->west, at->longitude_deg);
    area->east = std::max(area->east, at->longitude_deg);
    area->south = std::min(area->south, at->latitude_deg);
    area->north = std::max(area->north, at->latitude_deg);
  }
  // PROJ never comes back from an area without width.
  if (area && !(area->west < area->east && area->south < area->north)) return std::nullopt;
  return area;
}

CrsTransform::CrsTransform(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
CrsTransform::~CrsTransform() = default;
const std::string& CrsTransform::name() const { return impl_->name; }

bool CrsTransform::is_ballpark() const {
  return proj_coordoperation_has_ballpark_transformation(impl_->context.get(),
                                                         impl_->operation.get()) == 1;
}

std::unique_ptr<CrsTransform> CrsTransform::make(const CrsText& crs,
                                                 std::span<const MapPoint> extent) {
  for (const int axis : crs.axes) QMPIPE_CHECK(std::abs(axis) == 1 || std::abs(axis) == 2);
  auto impl = std::make_unique<Impl>();
  impl->axes = crs.axes;
  impl->context.reset(proj_context_create());
  proj_log_level(impl->context.get(), PJ_LOG_NONE);
  const Object globe(proj_create(impl->context.get(), "EPSG:4326"));
  // No matter of the raster's CRS.
  if (!globe) {
    throw IoError("cannot use", "the database of PROJ",
                  "it cannot be read, for want of memory or of proj.db",
                  "give less to do at a time (--threads 1) where memory is short; else install "
                  "proj-data, or set PROJ_LIB to the folder of proj.db");
  }
  const Object plane(proj_create(impl->context.get(), crs.wkt.c_str()));
  if (!plane) return nullptr;
  if (impl->choose(globe, plane, extent, std::nullopt) == 0) return nullptr;
  // Which operation is best depends on the place, and the place is known only through a first one.
  if (const std::optional<Area> area = impl->area_of(extent)) {
    impl->choose(globe, plane, extent, area);
  }
  const char* name = proj_get_name(impl->operation.get());
  impl->name = name != nullptr ? name : "";
  return std::unique_ptr<CrsTransform>(new CrsTransform(std::move(impl)));
}

// Through the CRS's own longitudes and latitudes: on another datum's, x would be a little off.
double CrsTransform::turn_along_x(const CrsText& crs) {
  Impl impl;
  impl.axes = crs.axes;
  impl.context.reset(proj_context_create());
  PJ_CONTEXT* const context = impl.context.get();
  proj_log_level(context, PJ_LOG_NONE);
  const Object plane(proj_create(context, crs.wkt.c_str()));
  if (!plane) return 0;
  const Object geographic(proj_crs_get_geodetic_crs(context, plane.get()));
  if (!geographic) return 0;
  const std::optional<LongitudeAxis> axis = longitude_axis(context, geographic.get());
  const Object operation(
      proj_create_crs_to_crs_from_pj(context, geographic.get(), plane.get(), nullptr, nullptr));
  if (!axis || !operation) return 0;
  std::array<double, kLongitudes> first_x{};
  double turn = 0;
  for (const double parallel : kParallelsOfTurn) {
    std::array<MapPoint, kLongitudes> row{};
    for (std::size_t k = 0; k < row.size(); ++k) {
      PJ_COORD at = proj_coord(0, 0, 0, 0);
      at.v[axis->index] =
          axis->circle * ((static_cast<double>(k) + kFirstStep) / kLongitudes - 0.5);
      at.v[1 - axis->index] = axis->circle * parallel;
      const PJ_COORD c = proj_trans(operation.get(), PJ_FWD, at);
      if (!is_finite(c)) return 0;
      row[k] = impl.from_crs_axes(c);
    }
    if (turn == 0) {
      std::transform(row.begin(), row.end(), first_x.begin(),
                     [](const MapPoint& p) { return p.x; });
      turn = turn_of_steps(first_x);
    }
    if (!(turn > 0) || !goes_round(row, first_x, turn)) return 0;
  }
  return without_last_bits(turn);
}

std::optional<MapPoint> CrsTransform::forward(const LonLat& point) const {
  PJ* const operation = impl_->operation.get();
  const PJ_COORD c =
      proj_trans(operation, PJ_FWD, proj_coord(point.latitude_deg, point.longitude_deg, 0, 0));
  if (!is_finite(c)) {
    proj_errno_reset(operation);
    return std::nullopt;
  }
  return impl_->from_crs_axes(c);
}

std::optional<LonLat> CrsTransform::inverse(const MapPoint& point) const {
  return impl_->inverse_by(impl_->operation.get(), point);
}

}  // namespace qmpipe
