// What a person may choose about a build. Defaults stand here and nowhere else.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "formats/heights/tally.h"
#include "formats/tile_sets/folder_sink.h"
#include "pipeline/recipe/recipe.h"

namespace qmpipe {

struct InputOptions {
  // In order of priority: the first source that is valid at a post wins.
  std::vector<std::string> paths;
  // Overrides the CRS of all inputs; anything GDAL understands. DEFAULT: the inputs' own.
  std::string source_crs;
  // What the numbers of all inputs mean. DEFAULT: what the files say.
  HeightOptions heights = {};
  // DEFAULT: heights that Earth does not have end the run.
  HeightGuard guard = HeightGuard::kStop;
  // DEFAULT: bilinear.
  Resampling resampling = Resampling::kBilinear;
};

struct MeshOptions {
  // DEFAULT: geodetic.
  Projection projection = Projection::kGeodetic;
  // DEFAULT: 0. Above 0 the set has no roots, which few clients can use.
  std::int32_t min_zoom = 0;
  // Of tiles; a smaller one than the sampling zoom does not make the survey read or keep less.
  // DEFAULT: the sampling zoom, that is the coarsest whose posts are no wider apart than the pixels.
  std::optional<std::int32_t> max_zoom;
  // DEFAULT: greedy.
  Method method = Method::kGreedy;
  // What ends edge collapse. DEFAULT: the tolerance.
  Stop stop = Stop::kTolerance;
  // DEFAULT: Campos et al. 2020, Table 3.
  MethodParameters parameters;
  // Zooms with a tolerance of their own, in place of the parameter g_e.
  std::map<std::int32_t, double> tolerance_at_m;
  // DEFAULT: mean.
  Reduction reduction = Reduction::kMean;
  // DEFAULT: pull.
  VoidPolicy voids;
};

struct EncodeOptions {
  // 1..12, none for plain tiles. DEFAULT: 7: within half a per cent of 9 in less than half the time.
  std::optional<int> gzip_level = 7;
  // DEFAULT: yes.
  bool normals = true;
};

struct RunOptions {
  // DEFAULT: as many as the machine has cores.
  std::int32_t threads = 1;
  // For the whole process; 0: nine tenths of the machine's memory. DEFAULT: 0.
  std::int64_t memory_bytes = 0;
  // Between two checkpoints of the mesh pass, at least; 0: none at all, and an interrupted run starts
  // again. DEFAULT: 10.
  double checkpoint_s = 10;
  // Leaves the run folder with its stores when the output is whole. DEFAULT: no.
  bool keep_run = false;
  bool dry_run = false;
};

struct OutputOptions {
  std::filesystem::path path;
  // What a run keeps on disk until it is done. DEFAULT: empty, OUT.qmpipe-run.
  std::filesystem::path run_folder;
  Overwrite overwrite = Overwrite::kNo;
  std::string name;
  std::string description;
  std::string attribution;
};

struct BuildOptions {
  InputOptions input;
  MeshOptions mesh;
  EncodeOptions encode;
  RunOptions run;
  OutputOptions output;
};

// Every rule that the options break, each a sentence that names the option; empty when all is well.
std::vector<std::string> violated_rules(const BuildOptions& options);

// The tolerance g(z) in metres. Methods without an error bound take their height steps from it.
double tolerance_at(const MeshOptions& options, std::int32_t zoom);

// The method's parameters at a zoom, g_e being the tolerance. Throws UsageError for a value that is
// out of its range there.
ParameterValues parameters_at(const MeshOptions& options, std::int32_t zoom);

}  // namespace qmpipe
