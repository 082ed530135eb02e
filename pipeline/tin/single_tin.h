// `qmpipe tin`: one DEM to one TIN, at the DEM's own pixels and in memory as a whole.
//
// Guarantees: the same file and options give the same mesh, bit for bit. Errors are those of valid posts.
// Voids are filled for the simplification and left out of the TIN afterwards (stages/surface/void_posts.h).
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "formats/tile/mesh_export.h"
#include "pipeline/recipe/method.h"
#include "pipeline/tin/dem.h"
#include "pipeline/tin/tin_target.h"

namespace qmpipe {

// Table 2 of Campos et al. 2020, for single DEMs, where it differs from Table 3.
MethodParameters single_dem_parameters();

struct SingleTinOptions {
  std::string input;
  // As in OpenOptions. DEFAULT: empty, the file's own.
  std::string source_crs = {};
  HeightOptions heights = {};
  HeightGuard guard = HeightGuard::kStop;
  Method method = Method::kGreedy;
  Stop stop = Stop::kTolerance;
  // Their values at zoom 0 count.
  MethodParameters parameters = single_dem_parameters();
  TinTarget target = {};
  // For the whole process; 0: nine tenths of the machine's memory.
  std::int64_t memory_bytes = 0;
};

struct SingleTin {
  Dem dem;
  TargetedTin result;
  double read_s = 0;
  double simplify_s = 0;
};

// What a run takes at its peak, about.
std::int64_t single_tin_bytes(Method method, std::int64_t post_count);

// Throws UsageError for options that make no sense together, a DEM that is too large for the memory and
// a target that cannot be met; IoError as RasterSource and read_dem() do.
SingleTin make_single_tin(const SingleTinOptions& options);

// Metres east, north and up from the middle of the DEM at height 0, or the CRS's own x and y with
// heights in metres.
enum class TinFrame { kLocal, kCrs };
ExportMesh mesh_of(const SingleTin& single, TinFrame frame);

}  // namespace qmpipe
