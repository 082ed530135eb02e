// Several methods on one input: the evaluation of Campos et al. 2020, section 5, for anybody's DEM.
//
// Each method builds a whole pyramid in a folder of its own, which is then verified and measured
// against the source as `qmpipe verify --source --hausdorff` does. One tile without voids is also
// simplified alone, without its neighbours' borders, several times (the paper's section 5.1).
// Guarantees: everything but times depends on the input and the parameters alone.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/build/build.h"
#include "pipeline/verify/verify.h"
#include "stages/surface/tin.h"

namespace qmpipe {

struct ComparedChoice {
  Method method = Method::kGreedy;
  Stop stop = Stop::kTolerance;
};

// "greedy", "edge-collapse:edges", "edge-collapse:tolerance", ...: the same in files and on the
// command line. "edge-collapse" alone reads as by tolerance.
std::string name_of(const ComparedChoice& choice);
Result<ComparedChoice> compared_choice_named(const std::string& name);

struct CompareOptions {
  // Its method and output are not used.
  BuildOptions build;
  // In the order of the report. REQUIRES: at least one, none twice.
  std::vector<ComparedChoice> methods;
  // Where the pyramids are built, one folder for each method's name.
  std::filesystem::path folder;
};

// One tile alone.
struct TileTrial {
  ParameterValues parameters;
  double seconds = 0;  // of one core: the median of several runs
  Tin tin;
  ErrorSummary error;
  HausdorffDistances hausdorff;
};

struct ComparedMethod {
  ComparedChoice choice;
  Recipe recipe;
  BuildReport build;
  verify::VerifyReport verify;
  std::optional<TileTrial> trial;
};

struct Comparison {
  std::vector<std::string> inputs;
  Projection projection = Projection::kGeodetic;
  std::int32_t threads = 0;
  std::vector<ComparedMethod> methods;
  // The tile of the trials: of the deepest zoom that has tiles without voids, the one that the first
  // method needs most triangles for. None where every tile has voids.
  std::optional<TileKey> tile;
  std::vector<float> tile_heights_m;  // of its 257 x 257 posts
};

// Throws as build_pyramid() and verify() do.
Comparison compare_methods(const CompareOptions& options, Progress& progress);

}  // namespace qmpipe
