#include "pipeline/compare/compare.h"

#include <fmt/format.h>

#include <algorithm>

#include "formats/bytes/errors.h"
#include "formats/tile_sets/open_tile_set.h"
#include "pipeline/build/forecast.h"
#include "pipeline/common/stopwatch.h"
#include "pipeline/verify/source.h"
#include "stages/finish/mesh_order.h"
#include "stages/finish/quantize.h"

namespace qmpipe {
namespace {

constexpr int kTrialRuns = 5;

BuildOptions build_options_of(const CompareOptions& options, const ComparedChoice& choice) {
  BuildOptions build = options.build;
  build.mesh.method = choice.method;
  build.mesh.stop = choice.stop;
  build.output.path = options.folder / name_of(choice);
  build.output.overwrite = Overwrite::kYes;
  return build;
}

// Of all methods: the time left is that of the whole comparison.
void expect_phases(const CompareOptions& options, Progress& progress) {
  const SurveyChoice survey = survey_choice(options.build);
  const std::vector<RasterInfo> sources = describe_inputs(survey);
  std::vector<ExpectedPhase> phases;
  for (const ComparedChoice& choice : options.methods) {
    const BuildOptions build = build_options_of(options, choice);
    const auto to_build = phases_of_build(build, survey, sources);
    const auto to_verify = phases_of_verify(expected_tiles(build, survey, sources),
                                            AgainstSource::kYes, build.run.threads);
    phases.insert(phases.end(), to_build.begin(), to_build.end());
    phases.insert(phases.end(), to_verify.begin(), to_verify.end());
  }
  phases.push_back({.name = "survey"});
  progress.expect(std::move(phases));
}

ComparedMethod build_and_measure(const CompareOptions& options, const ComparedChoice& choice,
                                 Progress& progress) {
  const BuildOptions build = build_options_of(options, choice);
  progress.note(fmt::format("{}: building", name_of(choice)));
  BuildResult built = build_pyramid(build, progress);
  progress.note(fmt::format("{}: measuring", name_of(choice)));
  const verify::VerifyOptions verify_options = {.sources = build.input.paths,
                                                .heights = build.input.heights,
                                                .hausdorff = verify::HausdorffMode::kMeasured,
                                                .threads = build.run.threads};
  return {.choice = choice,
          .recipe = std::move(built.recipe),
          .build = std::move(built.report),
          .verify = verify::verify_set(*open_tile_set(build.output.path), verify_options, progress),
          .trial = std::nullopt};
}

// The most rugged tile without voids of the deepest zoom that has one; equal ones by key.
std::optional<TileKey> choose_tile(const verify::VerifyReport& report) {
  std::optional<TileKey> chosen;
  for (const verify::ZoomReport& zoom : report.zooms) {
    const auto best =
        std::max_element(zoom.measured.begin(), zoom.measured.end(),
                         [](const verify::MeasuredTile& a, const verify::MeasuredTile& b) {
                           return a.triangles < b.triangles;
                         });
    if (best != zoom.measured.end()) chosen = best->key;
  }
  return chosen;
}

TileTrial try_tile(const Recipe& recipe, const TileKey& key, std::span<const float> heights_m) {
  const TilingScheme scheme(recipe.projection);
  const PostGrid grid = make_tile_grid(scheme, key);
  const HeightSteps steps = recipe.steps_for(key.zoom, heights_m);
  const MethodOptions options = recipe.options_for(key, steps);
  TileTrial trial;
  std::vector<double> seconds;
  for (int run = 0; run < kTrialRuns; ++run) {
    const Stopwatch watch;
    trial.tin = simplify(grid, heights_m, {}, options);
    seconds.push_back(watch.seconds());
  }
  std::nth_element(seconds.begin(), seconds.begin() + kTrialRuns / 2, seconds.end());
  trial.seconds = seconds[kTrialRuns / 2];
  trial.tin = strip_ordered(trial.tin);
  for (const ParameterInfo& info : parameters_of(recipe.method, recipe.stop)) {
    trial.parameters.emplace(info.name, recipe.parameters_at(key.zoom).at(info.name));
  }
  const QuantizedMesh mesh = quantize(grid, trial.tin, steps);
  const std::vector<std::uint8_t> valid(kTilePostCount, 1);
  trial.error = measure_error(grid, mesh, heights_m, valid);
  trial.hausdorff = tile_hausdorff(scheme, key, mesh, heights_m);
  return trial;
}

void try_all(const CompareOptions& options, Comparison& comparison, Progress& progress) {
  comparison.tile = choose_tile(comparison.methods.front().verify);
  if (!comparison.tile) {
    progress.note("no tile is free of voids: there are no distances and no single-tile trials");
    return;
  }
  const verify::SourceOptions source = {.inputs = options.build.input.paths,
                                        .source_crs = options.build.input.source_crs,
                                        .threads = options.build.run.threads,
                                        .heights = options.build.input.heights};
  const TilingScheme scheme(options.build.mesh.projection);
  const auto posts =
      verify::open_source_posts(source, scheme, comparison.methods.front().recipe, progress);
  const std::optional<WindowHeights> window = posts->posts(*comparison.tile);
  QMPIPE_CHECK(window.has_value());
  comparison.tile_heights_m = window->heights_m;
  for (ComparedMethod& method : comparison.methods) {
    progress.check_stop();
    method.trial = try_tile(method.recipe, *comparison.tile, comparison.tile_heights_m);
  }
}

}  // namespace

std::string name_of(const ComparedChoice& choice) {
  const std::string name = name_of(choice.method);
  return choice.method == Method::kEdgeCollapse ? name + ":" + name_of(choice.stop) : name;
}

Result<ComparedChoice> compared_choice_named(const std::string& name) {
  const auto colon = name.find(':');
  const Result<Method> method = method_named(name.substr(0, colon));
  if (!method) return method.error();
  ComparedChoice choice{.method = *method};
  if (colon == std::string::npos) return choice;
  const Result<Stop> stop = stop_named(name.substr(colon + 1));
  if (!stop) return stop.error();
  if (choice.method != Method::kEdgeCollapse) {
    return Error{fmt::format("\"{}\": only edge-collapse has a choice of what it stops at", name)};
  }
  choice.stop = *stop;
  return choice;
}

Comparison compare_methods(const CompareOptions& options, Progress& progress) {
  QMPIPE_CHECK(!options.methods.empty());
  Comparison comparison;
  comparison.inputs = options.build.input.paths;
  comparison.projection = options.build.mesh.projection;
  comparison.threads = options.build.run.threads;
  expect_phases(options, progress);
  for (const ComparedChoice& choice : options.methods) {
    comparison.methods.push_back(build_and_measure(options, choice, progress));
  }
  try_all(options, comparison, progress);
  return comparison;
}

}  // namespace qmpipe
