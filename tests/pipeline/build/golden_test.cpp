// Two tiles of a tiny DEM as text, to be read by people when they change on purpose.
// To write them anew: QMPIPE_REGENERATE_GOLDENS=1 build/dev/tests/golden_test, then review the diff
// and list the change of bytes in CHANGELOG.md.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <regex>

#include "formats/tile/quantized_mesh.h"
#include "formats/tile_sets/open_tile_set.h"
#include "pipeline/build/build.h"
#include "tests/support/raster_fixture.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::golden_test {
namespace {

std::string list_text(const std::vector<std::uint32_t>& list) {
  std::string text;
  for (const std::uint32_t k : list) text += fmt::format(" {}", k);
  return text;
}

// Millimetres and six digits of the occlusion point: beyond them the C library's sine may differ.
std::string tile_text(const TileKey& key, const QuantizedMesh& mesh) {
  const QuantizedMeshHeader& header = mesh.header;
  const auto vector_text = [](const Vec3& v, int digits) {
    return fmt::format("{:.{}f} {:.{}f} {:.{}f}", v[0], digits, v[1], digits, v[2], digits);
  };
  std::string text =
      fmt::format("tile {}\nheights {} {}\ncentre {}\nsphere {} {:.3f}\nocclusion {}\n",
                  to_string(key), header.min_height_m, header.max_height_m,
                  vector_text(header.centre_ecef_m, 3), vector_text(header.sphere_centre_ecef_m, 3),
                  header.sphere_radius_m, vector_text(header.horizon_occlusion_point, 6));
  for (std::size_t k = 0; k < mesh.vertex_count(); ++k) {
    text += fmt::format("vertex {} {} {} normal {} {}\n", mesh.u[k], mesh.v[k], mesh.h[k],
                        mesh.normals.at(k)[0], mesh.normals.at(k)[1]);
  }
  for (std::size_t t = 0; t < mesh.indices.size(); t += 3) {
    text += fmt::format("triangle {} {} {}\n", mesh.indices[t], mesh.indices[t + 1],
                        mesh.indices[t + 2]);
  }
  for (const Side side : kSides) {
    text += fmt::format("{}{}\n", name_of(side), list_text(mesh.sides[index_of(side)]));
  }
  return text;
}

TEST(Golden, TilesOfASmallDemAreAsReviewed) {
  const testing::TemporaryFolder folder;
  testing::RasterFixture fixture;
  fixture.width = 70;
  fixture.height = 60;
  fixture.geotransform = {{7, 0.01, 0, 45, 0, -0.01}};
  fixture.type = "Int16";
  fixture.void_value = -32768;
  // Whole numbers only, so that every machine reads the same.
  fixture.value = [](int c, int r) {
    if (c > 50 && r > 45) return -32768.0;
    return static_cast<double>((c - 30) * (r - 20) + (c * c) / 7 + 25 * ((r / 9) % 3));
  };
  BuildOptions options;
  options.input.paths = {testing::file_in(folder, "dem.tif")};
  testing::write_raster(options.input.paths.front(), fixture);
  options.output.path = folder.path() / "tiles";
  options.output.name = "golden";
  Progress progress(ProgressStyle::kSilent, nullptr);
  build_pyramid(options, progress);

  const auto set = open_tile_set(options.output.path);
  // The version is a hash of every bit, the C library's last one included.
  std::string text =
      std::regex_replace(*set->layer_text(), std::regex("1\\.0\\.0-[0-9a-f]{16}"), "(hash)");
  for (const TileKey& key : {TileKey{.zoom = 5, .x = 33, .y = 23}, set->keys().back()}) {
    const auto bytes = plain_tile_bytes(*set->read(key));
    ASSERT_TRUE(bytes.ok());
    const auto mesh = decode(*bytes);
    ASSERT_TRUE(mesh.ok());
    text += tile_text(key, *mesh);
  }

  const std::filesystem::path golden =
      std::filesystem::path(QMPIPE_SOURCE_DIR) / "tests/golden/small_dem.txt";
  if (std::getenv("QMPIPE_REGENERATE_GOLDENS") != nullptr) {
    std::filesystem::create_directories(golden.parent_path());
    std::ofstream(golden) << text;
    GTEST_SKIP() << "wrote " << golden;
  }
  std::ifstream in(golden);
  const std::string expected{std::istreambuf_iterator<char>(in), {}};
  EXPECT_EQ(text, expected);
}

}  // namespace
}  // namespace qmpipe::golden_test
