#include "tests/support/build_fixture.h"

#include <cmath>
#include <numbers>
#include <random>

#include "formats/tile_sets/open_tile_set.h"
#include "pipeline/verify/verify.h"

namespace qmpipe::testing {

RasterFixture hilly_raster(std::uint32_t seed, double west_deg, double north_deg,
                           double pixel_deg) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> phase(0, 2 * std::numbers::pi);
  const double a = phase(random);
  const double b = phase(random);
  RasterFixture fixture;
  fixture.width = 300;
  fixture.height = 260;
  fixture.geotransform = {{west_deg, pixel_deg, 0, north_deg, 0, -pixel_deg}};
  fixture.void_value = -9999;
  fixture.value = [a, b](int c, int r) {
    if (std::hypot(c - 150, r - 130) < 40) return -9999.0;
    return 900 * std::sin(c / 31.0 + a) * std::cos(r / 23.0 + b) +
           120 * std::sin(c / 5.0 + b) * std::sin(r / 4.0 + a) + 400;
  };
  return fixture;
}

std::string BuildTest::write(const RasterFixture& fixture, const std::string& name) {
  const std::string path = file_in(folder_, name);
  write_raster(path, fixture);
  return path;
}

BuildOptions BuildTest::options_for(const std::vector<std::string>& inputs,
                                    const std::string& out) {
  BuildOptions options;
  options.input.paths = inputs;
  options.output.path = folder_.path() / out;
  options.output.name = "test";
  options.run.threads = 2;
  return options;
}

BuildResult BuildTest::run(const BuildOptions& options) {
  Progress progress(ProgressStyle::kSilent, nullptr);
  return build_pyramid(options, progress);
}

std::map<std::string, std::vector<std::uint8_t>> BuildTest::contents(const BuildOptions& options) {
  std::map<std::string, std::vector<std::uint8_t>> files;
  const auto set = open_tile_set(options.output.path);
  for (const TileKey& key : set->keys()) files[to_string(key)] = *set->read(key);
  const std::string layer = *set->layer_text();
  files["layer.json"].assign(layer.begin(), layer.end());
  return files;
}

void BuildTest::expect_sound(const BuildOptions& options) {
  Progress progress(ProgressStyle::kSilent, nullptr);
  verify::VerifyOptions check;
  check.sources = options.input.paths;
  const verify::VerifyReport report =
      verify::verify_set(*open_tile_set(options.output.path), check, progress);
  EXPECT_EQ(report.fault_count, 0) << text_of(report);
  EXPECT_LT(report.largest_crack_m, 1e-3);
  EXPECT_GT(report.tiles, 0);
}

}  // namespace qmpipe::testing
