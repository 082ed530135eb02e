#include "pipeline/tin/tin_target.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>
#include <utility>

#include "formats/bytes/errors.h"
#include "scheduler/elementary.h"
#include "stages/surface/void_posts.h"

namespace qmpipe {
namespace {

constexpr double kFirstStride = 1.0 / 16;
constexpr double kFinestStride = 1.0 / 512;

// How much a point-set method leaves, on a logarithmic scale from 0 (most) to 1 (least).
struct SizeScale {
  const char* name;
  double finest;
  double coarsest;
};

SizeScale scale_of(Method method, const Dem& dem) {
  const PostGrid& grid = dem.grid;
  const double width_m = grid.u_exact.back() * grid.metres_per_u;
  const double height_m = grid.v_exact.back() * grid.metres_per_v;
  const double spacing_m =
      std::min(width_m / (grid.width_posts - 1), height_m / (grid.height_posts - 1));
  switch (method) {
    case Method::kPsGrid:
      return {.name = "d_g",
              .finest = spacing_m / 2,
              .coarsest = std::sqrt(width_m * width_m + height_m * height_m)};
    case Method::kPsHierarchy:
      return {.name = "h_c",
              .finest = 1,
              .coarsest = std::min(1e6, static_cast<double>(dem.post_count()))};
    case Method::kPsWlop:
      return {.name = "w_p", .finest = 100, .coarsest = 0.01};
    case Method::kPsRandom:
    case Method::kGreedy:
    case Method::kEdgeCollapse:
      break;
  }
  // Of what remains, because what is removed lies close to 100 % throughout.
  return {.name = "r_r", .finest = 100, .coarsest = 0.001};
}

bool counts_what_is_removed(const SizeScale& scale) {
  return std::string_view(scale.name) == "r_r";
}

double size_at(const SizeScale& scale, double place) {
  const double size = scale.finest * power(scale.coarsest / scale.finest, place);
  if (counts_what_is_removed(scale)) return 100 - size;
  return std::string_view(scale.name) == "h_c" ? std::round(size) : size;
}

double place_of(const SizeScale& scale, double value) {
  const double size = counts_what_is_removed(scale) ? 100 - value : value;
  if (!(size > 0)) return 1;
  const double place = logarithm(size / scale.finest) / logarithm(scale.coarsest / scale.finest);
  return std::clamp(place, 0.0, 1.0);
}

bool is_point_set(Method method) {
  return method != Method::kGreedy && method != Method::kEdgeCollapse;
}

// The distance of two floats at the DEM's heights.
double precision_m(const Dem& dem) {
  constexpr int kFloatDigits = std::numeric_limits<float>::digits;
  constexpr double kFinest = 1.0 / (1 << 20);
  const double farthest_m =
      std::max(std::abs(static_cast<double>(dem.low_m)), std::abs(static_cast<double>(dem.high_m)));
  return farthest_m > 0
             ? std::max(kFinest, std::ldexp(1.0, std::ilogb(farthest_m) - kFloatDigits + 1))
             : kFinest;
}

std::int64_t covered_voids(const Dem& dem, const Tin& tin) {
  std::vector<std::uint8_t> is_void;
  is_void.reserve(dem.valid.size());
  for (const std::uint8_t flag : dem.valid) is_void.push_back(flag == 0 ? 1 : 0);
  return measure_error(dem.grid, tin, dem.heights_m, is_void).posts;
}

class Aim {
 public:
  Aim(const Dem& dem, TinMethod method, const TinTarget& target)
      : dem_(dem),
        method_(std::move(method)),
        target_(target),
        tolerance_m_(tolerance_that_counts()) {
    const double least_m = least_tolerance_m(dem);
    if (tolerance_m_ && *tolerance_m_ < least_m) {
      throw UsageError(fmt::format(
          "{:g} m is finer than float32 can hold over heights from {:g} to {:g} m; give {:.2g} m "
          "or more",
          *tolerance_m_, dem.low_m, dem.high_m, least_m));
    }
    height_step_m_ = height_step_of(dem, tolerance_m_);
  }

  TargetedTin at_once() {
    aim_parameters();
    TargetedTin result = attempt(method_.values);
    if (!is_met(result)) refuse(result);
    return result;
  }

  // The farthest place towards what is wanted (coarse for a tolerance, fine for a number of triangles)
  // that still meets the target: from the parameter's own value outwards in growing strides, then by
  // halves between.
  TargetedTin searched() {
    const SizeScale scale = scale_of(method_.method, dem_);
    const bool to_coarser = target_.tolerance_m.has_value();
    const auto meets = [&](double place) {
      ParameterValues values = method_.values;
      values[scale.name] = size_at(scale, to_coarser ? place : 1 - place);
      TargetedTin result = attempt(values);
      if (!is_met(result)) {
        missed_ = std::move(result);
        return false;
      }
      best_ = std::move(result);
      return true;
    };
    const double own = place_of(scale, method_.values.at(scale.name));
    double inside = to_coarser ? own : 1 - own;
    double outside = inside;
    double stride = kFirstStride;
    if (meets(inside)) {
      while (outside == inside && inside < 1) {
        outside = std::min(1.0, inside + stride);
        if (meets(outside)) inside = outside;
        stride *= 2;
      }
    } else {
      while (outside == inside || !best_) {
        if (inside == 0) refuse(*missed_);
        outside = inside;
        inside = std::max(0.0, inside - stride);
        meets(inside);
        stride *= 2;
      }
    }
    while (outside - inside > kFinestStride) {
      const double middle = (inside + outside) / 2;
      (meets(middle) ? inside : outside) = middle;
    }
    best_->attempts = attempts_;
    return std::move(*best_);
  }

 private:
  // For the methods that hold one, also that of the parameters.
  std::optional<double> tolerance_that_counts() const {
    if (target_.tolerance_m) return target_.tolerance_m;
    if (target_.most_triangles || !has_error_bound(method_.method, method_.stop)) {
      return std::nullopt;
    }
    return method_.values.at("g_e");
  }

  void aim_parameters() {
    if (target_.tolerance_m && has_error_bound(method_.method, method_.stop)) {
      method_.values["g_e"] = *target_.tolerance_m;
    }
    if (!target_.most_triangles) return;
    if (method_.method == Method::kGreedy) {
      method_.values["g_e"] = std::max(least_tolerance_m(dem_), height_step_m_);
    }
    if (method_.method != Method::kEdgeCollapse) return;
    // Euler: of E edges, B on the outline, 2 E - B are sides of triangles, so T = (2 E - B) / 3;
    // and B is at least 4. Edge collapse stops below the number that it is given.
    method_.stop = Stop::kEdges;
    method_.values.erase("g_e");
    const std::int64_t most_edges = (3 * *target_.most_triangles + 4) / 2;
    method_.values["e_e"] = static_cast<double>(most_edges + 1);
  }

  TargetedTin attempt(const ParameterValues& values) {
    ++attempts_;
    MethodOptions options =
        method_options(method_.method, method_.stop, values,
                       {.height_steps = height_step_m_, .curvature = Curvature::kIgnored});
    if (auto* const greedy = std::get_if<GreedyOptions>(&options);
        greedy != nullptr && target_.most_triangles) {
      // It may go one beyond.
      greedy->most_triangles = static_cast<std::int32_t>(std::min<std::int64_t>(
          *target_.most_triangles - 1, std::numeric_limits<std::int32_t>::max() - 1));
    }
    TargetedTin result;
    Tin whole = simplify(dem_.grid, dem_.heights_m, {}, options);
    const std::size_t triangles = whole.triangle_count();
    result.tin = dem_.void_count == 0
                     ? std::move(whole)
                     : without_void_triangles(dem_.grid, std::move(whole), dem_.valid);
    result.void_triangles = static_cast<std::int64_t>(triangles - result.tin.triangle_count());
    result.error = measure_error(dem_.grid, result.tin, dem_.heights_m, dem_.valid);
    result.values = values;
    result.height_step_m = height_step_m_;
    return result;
  }

  bool is_met(const TargetedTin& result) const {
    if (target_.most_triangles) {
      return static_cast<std::int64_t>(result.tin.triangle_count()) <= *target_.most_triangles;
    }
    return !target_.tolerance_m || result.error.largest_m <= *target_.tolerance_m;
  }

  [[noreturn]] void refuse(const TargetedTin& reached) const {
    std::string values;
    for (const auto& [name, value] : reached.values) {
      values += fmt::format("{}{}={:g}", values.empty() ? "" : " ", name, value);
    }
    const std::string method = name_of(method_.method);
    if (target_.most_triangles) {
      throw UsageError(fmt::format(
          "--triangles {}: {} leaves {} at least ({}); allow more of them, or give the other "
          "parameters coarser values",
          *target_.most_triangles, method, reached.tin.triangle_count(), values));
    }
    throw UsageError(fmt::format(
        "--tolerance {:g}: {} comes no closer than {:.4g} m ({}); allow a larger error, "
        "give the other parameters finer values, or take --method greedy",
        *target_.tolerance_m, method, reached.error.largest_m, values));
  }

  const Dem& dem_;
  TinMethod method_;
  TinTarget target_;
  std::optional<double> tolerance_m_;
  double height_step_m_ = 0;
  std::int32_t attempts_ = 0;
  std::optional<TargetedTin> best_;
  std::optional<TargetedTin> missed_;
};

}  // namespace

double height_step_of(const Dem& dem, const std::optional<double>& tolerance_m) {
  const double range_m = static_cast<double>(dem.high_m) - static_cast<double>(dem.low_m);
  const double wanted = tolerance_m ? *tolerance_m / 16 : range_m / 65536;
  // Not by log2(), which rounds up just below a power of two.
  return std::max(precision_m(dem), wanted > 0 ? std::ldexp(1.0, std::ilogb(wanted)) : 0);
}

double least_tolerance_m(const Dem& dem) {
  // stages/greedy/post_errors.cpp takes this off a tolerance, but no more than half of it.
  const double range_m = static_cast<double>(dem.high_m) - static_cast<double>(dem.low_m);
  const double lost_m =
      6 * (range_m / 2) * static_cast<double>(std::numeric_limits<float>::epsilon());
  return 2 * std::max(lost_m, precision_m(dem));
}

TargetedTin simplify_to_target(const Dem& dem, const TinMethod& method, const TinTarget& target) {
  const bool has_target = target.tolerance_m || target.most_triangles;
  Aim aim(dem, method, target);
  TargetedTin result = has_target && is_point_set(method.method) ? aim.searched() : aim.at_once();
  if (dem.void_count > 0) result.covered_voids = covered_voids(dem, result.tin);
  return result;
}

}  // namespace qmpipe
