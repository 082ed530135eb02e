#include "formats/crs_transform.h"

#include <proj.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <type_traits>
#include <utility>

#include "formats/free_with.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

using Context = std::unique_ptr<PJ_CONTEXT, FreeWith<proj_context_destroy>>;
using Object = std::unique_ptr<PJ, FreeWith<proj_destroy>>;
using ObjectList = std::unique_ptr<PJ_OBJ_LIST, FreeWith<proj_list_destroy>>;
using Factory =
    std::unique_ptr<PJ_OPERATION_FACTORY_CONTEXT, FreeWith<proj_operation_factory_context_destroy>>;

bool is_finite(const PJ_COORD& c) { return std::isfinite(c.v[0]) && std::isfinite(c.v[1]); }

// Degrees east of west to east; narrower than the list may suggest when it crosses the
// antimeridian.
struct Area {
  double west = 0;
  double south = 0;
  double east = 0;
  double north = 0;
};

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
  const Object plane(proj_create(impl->context.get(), crs.wkt.c_str()));
  if (!globe || !plane) return nullptr;
  if (impl->choose(globe, plane, extent, std::nullopt) == 0) return nullptr;
  // Which operation is best depends on the place, and the place is known only through a first one.
  if (const std::optional<Area> area = impl->area_of(extent)) {
    impl->choose(globe, plane, extent, area);
  }
  const char* name = proj_get_name(impl->operation.get());
  impl->name = name != nullptr ? name : "";
  return std::unique_ptr<CrsTransform>(new CrsTransform(std::move(impl)));
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
