#include "formats/crs/vertical.h"

#include <proj.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "formats/bytes/free_with.h"
#include "formats/bytes/letter_case.h"

namespace qmpipe {
namespace {

using ProjContext = std::unique_ptr<PJ_CONTEXT, FreeWith<proj_context_destroy>>;
using ProjObject = std::unique_ptr<PJ, FreeWith<proj_destroy>>;

bool names_ellipsoid(const std::string& name) {
  return lower_case(name).find("ellipsoid") != std::string::npos;
}

// Without the transformation to WGS84 that it may be bound to.
ProjObject unbound(PJ_CONTEXT* context, ProjObject crs) {
  while (crs && proj_get_type(crs.get()) == PJ_TYPE_BOUND_CRS) {
    crs.reset(proj_get_source_crs(context, crs.get()));
  }
  return crs;
}

void take_axis(PJ_CONTEXT* context, const PJ* crs, int axis, VerticalCrs& vertical) {
  const ProjObject system(proj_crs_get_coordinate_system(context, crs));
  const char* direction = nullptr;
  const char* unit = nullptr;
  double metres = 0;
  if (!system || axis >= proj_cs_get_axis_count(context, system.get()) ||
      proj_cs_get_axis_info(context, system.get(), axis, nullptr, nullptr, &direction, &metres,
                            &unit, nullptr, nullptr) == 0) {
    return;
  }
  vertical.points_down = direction != nullptr && std::string(direction) == "down";
  if (metres > 0 && std::isfinite(metres)) {
    vertical.metres_per_unit = metres;
    vertical.unit = unit != nullptr ? unit : "";
  }
}

}  // namespace

VerticalCrs vertical_crs_of(const std::string& wkt) {
  VerticalCrs vertical;
  const ProjContext context(proj_context_create());
  proj_log_level(context.get(), PJ_LOG_NONE);
  const ProjObject crs =
      unbound(context.get(), ProjObject(proj_create(context.get(), wkt.c_str())));
  if (!crs) return vertical;
  if (proj_get_type(crs.get()) == PJ_TYPE_COMPOUND_CRS) {
    const ProjObject heights =
        unbound(context.get(), ProjObject(proj_crs_get_sub_crs(context.get(), crs.get(), 1)));
    if (!heights) return vertical;
    const char* name = proj_get_name(heights.get());
    vertical.name = name != nullptr ? name : "";
    vertical.reference =
        names_ellipsoid(vertical.name) ? HeightReference::kEllipsoid : HeightReference::kDatum;
    take_axis(context.get(), heights.get(), 0, vertical);
    return vertical;
  }
  const ProjObject system(proj_crs_get_coordinate_system(context.get(), crs.get()));
  if (!system || proj_cs_get_axis_count(context.get(), system.get()) != 3) return vertical;
  vertical.reference = HeightReference::kEllipsoid;
  take_axis(context.get(), crs.get(), 2, vertical);
  return vertical;
}

}  // namespace qmpipe
