// Files on one grid are one raster: however it was cut, its posts are the same, bit for bit.
#include "formats/sources/joined_grids.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>

#include "formats/sources/grid_pixels.h"
#include "stages/posts/sampling.h"
#include "tests/support/raster_fixture.h"

namespace qmpipe::testing::joined_grids_test {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

bool same_bits(float a, float b) { return a == b || (std::isnan(a) && std::isnan(b)); }

std::vector<RasterInfo> joined(const std::vector<std::string>& paths) {
  std::vector<RasterInfo> infos;
  for (const std::string& path : paths) infos.push_back(RasterSource::open(path)->info());
  join_grids(infos);
  return infos;
}

// As gdal_translate -srcwin writes it.
RasterFixture part_of(const RasterFixture& whole, const PixelWindow& window) {
  RasterFixture part = whole;
  part.width = static_cast<int>(window.width);
  part.height = static_cast<int>(window.height);
  const std::array<double, 6>& g = *whole.geotransform;
  const auto c0 = static_cast<double>(window.column0);
  const auto r0 = static_cast<double>(window.row0);
  part.geotransform = {
      {g[0] + c0 * g[1] + r0 * g[2], g[1], g[2], g[3] + c0 * g[4] + r0 * g[5], g[4], g[5]}};
  part.value = [value = whole.value, window](int c, int r) {
    return value(c + static_cast<int>(window.column0), r + static_cast<int>(window.row0));
  };
  return part;
}

class JoinedGrids : public ::testing::Test {
 protected:
  std::size_t pick(std::size_t low, std::size_t high) { return low + dice_() % (high - low + 1); }

  std::string write(const RasterFixture& fixture) {
    const std::string path = file_in(folder_, "r" + std::to_string(number_++) + ".tif");
    write_raster(path, fixture);
    return path;
  }

  // Rectangles that cover a window: cut in two again and again, at any place.
  void cut(const PixelWindow& window, std::size_t pieces, std::vector<PixelWindow>& into) {
    const bool across = window.width >= window.height;
    const std::int64_t length = across ? window.width : window.height;
    if (pieces <= 1 || length < 2) {
      into.push_back(window);
      return;
    }
    const auto at = static_cast<std::int64_t>(pick(1, static_cast<std::size_t>(length - 1)));
    PixelWindow first = window;
    PixelWindow second = window;
    (across ? first.width : first.height) = at;
    (across ? second.width : second.height) = length - at;
    (across ? second.column0 : second.row0) += at;
    const std::size_t share = pick(1, pieces - 1);
    cut(first, share, into);
    cut(second, pieces - share, into);
  }

  PixelWindow widened(const PixelWindow& window, const RasterFixture& whole) {
    const auto more = [this] { return static_cast<std::int64_t>(pick(0, 3)); };
    PixelWindow wide = window;
    wide.column0 = std::max<std::int64_t>(0, window.column0 - more());
    wide.row0 = std::max<std::int64_t>(0, window.row0 - more());
    const std::int64_t right = window.column0 + window.width + more();
    const std::int64_t bottom = window.row0 + window.height + more();
    wide.width = std::min<std::int64_t>(whole.width, right) - wide.column0;
    wide.height = std::min<std::int64_t>(whole.height, bottom) - wide.row0;
    return wide;
  }

  std::vector<std::string> cut_files(const RasterFixture& whole, std::size_t pieces,
                                     bool may_turn) {
    std::vector<PixelWindow> windows;
    cut({.width = whole.width, .height = whole.height}, pieces, windows);
    std::shuffle(windows.begin(), windows.end(), dice_);
    const bool overlap = pick(0, 1) == 1;
    std::vector<std::string> paths;
    for (const PixelWindow& window : windows) {
      RasterFixture part = part_of(whole, overlap ? widened(window, whole) : window);
      // As files east of the antimeridian most often say it. The uncut raster begins in the west.
      if (may_turn && window.column0 > 0 && pick(0, 1) == 1) (*part.geotransform)[0] -= 360;
      paths.push_back(write(part));
    }
    return paths;
  }

  void expect_same_posts(const std::vector<std::string>& uncut,
                         const std::vector<std::string>& cut);

  const TemporaryFolder folder_;
  const unsigned seed_ = 20261129;
  std::mt19937 dice_{seed_};
  int number_ = 0;
};

// All posts around the rasters, and some windows of another zoom.
void JoinedGrids::expect_same_posts(const std::vector<std::string>& uncut,
                                    const std::vector<std::string>& cut) {
  const std::vector<RasterInfo> infos = joined(uncut);
  const RectangleDeg& box = infos.front().bounds_deg;
  // Mercator has no posts near a pole.
  const bool geodetic = pick(0, 1) == 0 || box.north_deg < -80;
  const TilingScheme scheme(geodetic ? Projection::kGeodetic : Projection::kMercator);
  const std::int32_t zoom = sampling_zoom_for(scheme, infos);
  ASSERT_EQ(sampling_zoom_for(scheme, joined(cut)), zoom);
  for (const std::int32_t z : {zoom, std::max(0, zoom - 2)}) {
    const Lattice lattice(scheme, z);
    const PostWindow window{
        .i0 = static_cast<std::int64_t>(lattice.column_at(box.west_deg)) - 3,
        .j0 = static_cast<std::int64_t>(lattice.row_at(box.south_deg)) - 3,
        .width_posts = static_cast<std::int32_t>(lattice.column_at(box.east_deg) -
                                                 lattice.column_at(box.west_deg)) +
                       6,
        .height_posts = static_cast<std::int32_t>(lattice.row_at(box.north_deg) -
                                                  lattice.row_at(box.south_deg)) +
                        6};
    for (const Resampling resampling :
         {Resampling::kBilinear, Resampling::kCubic, Resampling::kNearest}) {
      std::vector<float> expected(window.size());
      std::vector<float> heights(window.size());
      Sampler(pool_of(uncut), resampling).sample(lattice, window, expected);
      Sampler(pool_of(cut), resampling).sample(lattice, window, heights);
      std::size_t valid = 0;
      for (std::size_t k = 0; k < heights.size(); ++k) {
        valid += std::isnan(expected[k]) ? 0U : 1U;
        ASSERT_TRUE(same_bits(heights[k], expected[k]))
            << "zoom " << z << " post " << static_cast<std::int64_t>(k) % window.width_posts << ' '
            << static_cast<std::int64_t>(k) / window.width_posts << ": " << heights[k]
            << " and not " << expected[k];
      }
      EXPECT_GT(valid, 0U);
    }
  }
}

RasterFixture rough_raster(std::mt19937& dice, int width, int height) {
  RasterFixture fixture{.width = width, .height = height};
  const auto salt = static_cast<unsigned>(dice());
  const bool has_voids = dice() % 2 == 0;
  fixture.type = dice() % 2 == 0 ? "Int16" : "Float32";
  const double hole = fixture.type == "Int16" ? -32768 : kNaN;
  if (fixture.type == "Int16") fixture.void_value = -32768;
  fixture.value = [salt, has_voids, hole](int c, int r) {
    const unsigned mixed =
        (static_cast<unsigned>(c) * 7919U + static_cast<unsigned>(r) * 104729U + salt) *
        2654435761U;
    if (has_voids && mixed % 17 == 0) return hole;
    return std::round(300 * std::sin(c * 0.7) + 200 * std::cos(r * 1.3)) + (mixed >> 24U);
  };
  return fixture;
}

struct Place {
  const char* name;
  const char* crs;
  std::array<double, 6> geotransform;
  bool may_turn = false;
};

TEST_F(JoinedGrids, AnyCutOfARasterGivesItsPosts) {
  SCOPED_TRACE("seed " + std::to_string(seed_));
  const std::vector<Place> places = {
      {"degrees", "EPSG:4326", {10.02, 1.0 / 12, 0, 52.3, 0, -1.0 / 12}},
      {"across the antimeridian", "EPSG:4326", {178.7, 0.05, 0, -12, 0, -0.05}, true},
      {"decimals", "EPSG:4326", {6.999583333, 0.000833333, 0, 44.000416667, 0, -0.000833333}},
      {"upside down", "EPSG:4326", {-71.3, 0.1, 0, -33.2, 0, 0.1}},
      {"another datum", "EPSG:4267", {-118, 0.02, 0, 38, 0, -0.02}},
      {"metres", "EPSG:32631", {600000, 90, 0, 5000000, 0, -90}},
      {"another datum in metres", "EPSG:26711", {300000, 500, 0, 4200000, 0, -500}},
      {"Mercator past 180 degrees", "EPSG:3857", {19950000, 2000, 0, -1500000, 0, -2000}},
      {"the pole", "EPSG:3031", {-250000, 9000, 0, 200000, 0, -9000}},
      {"turned", "EPSG:32631", {600000, 80, 30, 5000000, 30, -80}}};
  for (std::size_t turn = 0; turn < 20; ++turn) {
    const Place& place = places[turn % places.size()];
    const auto width = static_cast<int>(pick(12, 90));
    const auto height = static_cast<int>(pick(12, 70));
    RasterFixture whole = rough_raster(dice_, width, height);
    whole.crs = place.crs;
    whole.geotransform = place.geotransform;
    const std::vector<std::string> files = cut_files(whole, pick(2, 12), place.may_turn);
    SCOPED_TRACE(std::string(place.name) + ", " + std::to_string(files.size()) + " files, turn " +
                 std::to_string(turn));
    expect_same_posts({write(whole)}, files);
    if (HasFatalFailure()) return;
  }
}

TEST_F(JoinedGrids, AnyCutOfTheWholeGlobeGivesItsPosts) {
  SCOPED_TRACE("seed " + std::to_string(seed_));
  for (const double west_deg : {-180.0, 0.0, -180.5, 33.0}) {
    for (const char* crs : {"EPSG:4326", "EPSG:4087"}) {
      RasterFixture whole = rough_raster(dice_, 120, 60);
      const double unit = crs == std::string("EPSG:4326") ? 1 : 6378137 * 3.14159265358979 / 180;
      whole.crs = crs;
      whole.geotransform = {{west_deg * unit, 3 * unit, 0, 90 * unit, 0, -3 * unit}};
      const std::vector<std::string> files = cut_files(whole, pick(2, 9), false);
      SCOPED_TRACE(std::string(crs) + " west " + std::to_string(west_deg));
      expect_same_posts({write(whole)}, files);
      if (HasFatalFailure()) return;
    }
  }
}

TEST_F(JoinedGrids, TheWholeGridIsTheUncutRasters) {
  SCOPED_TRACE("seed " + std::to_string(seed_));
  RasterFixture whole = rough_raster(dice_, 60, 40);
  whole.geotransform = {{178.7, 0.1, 0, -12, 0, -0.1}};
  const RasterInfo uncut = joined({write(whole)}).front();
  EXPECT_EQ(uncut.part.whole, nullptr);
  std::vector<std::string> files = cut_files(whole, 7, true);
  for (int turn = 0; turn < 5; ++turn) {
    for (const RasterInfo& info : joined(files)) {
      ASSERT_NE(info.part.whole, nullptr);
      EXPECT_EQ(info.part.whole->plane, uncut.plane);
      EXPECT_EQ(info.part.whole->width, uncut.width);
      EXPECT_EQ(info.part.whole->height, uncut.height);
      EXPECT_EQ(info.part.whole->bounds_deg, uncut.bounds_deg);
      EXPECT_EQ(info.pixel_deg, uncut.pixel_deg);
    }
    std::shuffle(files.begin(), files.end(), dice_);
  }
}

// Two rasters of 8 x 8 pixels of a degree, the second so many pixels east and south of the first.
class TwoRasters : public JoinedGrids {
 protected:
  std::vector<RasterInfo> beside(double columns, double rows, double pixel_deg = 1,
                                 const std::string& crs = "EPSG:4326") {
    RasterFixture fixture{.width = 8, .height = 8};
    fixture.geotransform = {{0, 1, 0, 40, 0, -1}};
    const std::string first = write(fixture);
    fixture.crs = crs;
    fixture.geotransform = {{columns, pixel_deg, 0, 40 - rows, 0, -pixel_deg}};
    return joined({write(fixture), first});
  }
  bool are_joined(const std::vector<RasterInfo>& infos) {
    EXPECT_EQ(infos[0].part.whole, infos[1].part.whole);
    return infos[0].part.whole != nullptr;
  }
};

TEST_F(TwoRasters, AreJoinedWhereTheyTouchOnOneGrid) {
  EXPECT_TRUE(are_joined(beside(8, 0)));
  EXPECT_TRUE(are_joined(beside(8, 8)));
  EXPECT_TRUE(are_joined(beside(-8, 3)));
  EXPECT_TRUE(are_joined(beside(3, 3)));
  EXPECT_TRUE(are_joined(beside(0, 0)));
  EXPECT_TRUE(are_joined(beside(8 + 360, 0)));
  EXPECT_TRUE(are_joined(beside(8.005, 0.003)));
  EXPECT_TRUE(are_joined(beside(8, 0, 1.0001)));
  EXPECT_TRUE(are_joined(beside(8, 0, 1, "+proj=longlat +datum=WGS84 +type=crs")));
  EXPECT_FALSE(are_joined(beside(9, 0)));
  EXPECT_FALSE(are_joined(beside(0, 20)));
  EXPECT_FALSE(are_joined(beside(7.5, 0)));
  EXPECT_FALSE(are_joined(beside(8, 0.02)));
  EXPECT_FALSE(are_joined(beside(8, 0, 1.01)));
  EXPECT_FALSE(are_joined(beside(8, 0, 0.5)));
  EXPECT_FALSE(are_joined(beside(8, 0, 1, "EPSG:4267")));
}

TEST_F(TwoRasters, WhereTheyAreBesideEachOtherOnTheWholeGridIsTold) {
  const std::vector<RasterInfo> infos = beside(5, -3);
  ASSERT_TRUE(are_joined(infos));
  EXPECT_EQ(infos[0].part.column, 5);
  EXPECT_EQ(infos[0].part.row, 0);
  EXPECT_EQ(infos[1].part.column, 0);
  EXPECT_EQ(infos[1].part.row, 3);
  EXPECT_EQ(infos[0].part.whole->width, 13);
  EXPECT_EQ(infos[0].part.whole->height, 11);
}

// Where inputs overlap, the first that is valid wins, on one grid and with another between.
TEST_F(JoinedGrids, PrioritiesHoldWhereRastersOfOneGridOverlap) {
  const auto raster = [this](double west_deg, double north_deg, int width, double height_m,
                             double hole_m = kNaN) {
    RasterFixture fixture{.width = width, .height = 8};
    fixture.geotransform = {{west_deg, 1, 0, north_deg, 0, -1}};
    fixture.value = [height_m, hole_m](int c, int r) {
      return c == 2 && r == 4 ? hole_m : height_m;
    };
    return write(fixture);
  };
  const std::string first = raster(0, 40, 8, 100);
  const std::string second = raster(4, 40, 8, 200, 200);
  const std::string between = raster(2.5, 40.5, 16, 300, 300);
  const Lattice lattice(TilingScheme(Projection::kGeodetic), 6);
  const auto height = [&](const std::vector<std::string>& paths, double lon, double lat) {
    std::vector<float> one(1);
    Sampler(pool_of(paths), Resampling::kBilinear)
        .sample(lattice,
                {.i0 = std::lround(lattice.column_at(lon)),
                 .j0 = std::lround(lattice.row_at(lat)),
                 .width_posts = 1,
                 .height_posts = 1},
                one);
    return one[0];
  };
  EXPECT_EQ(height({first, second}, 5.5, 36.5), 100);
  EXPECT_EQ(height({second, first}, 5.5, 36.5), 200);
  EXPECT_EQ(height({first, second}, 10.5, 36.5), 200);
  // The hole in the first is filled from what lies beneath, if anything does.
  EXPECT_TRUE(std::isnan(height({first, second}, 2.5, 35.5)));
  EXPECT_NEAR(height({first, raster(0, 40, 8, 50, 50), second}, 2.5, 35.5), 50, 1);
  EXPECT_EQ(height({first, raster(0, 40, 8, 50, 50), second}, 3.5, 35.5), 100);
  // Between the pixels of both: at 7.75 a quarter of the way from the last pixel of the first.
  EXPECT_NEAR(height({first, second}, 7.75, 36.5), 125, 1);
  // A raster of another grid comes before the second.
  EXPECT_EQ(height({first, between, second}, 5.5, 36.5), 100);
  EXPECT_EQ(height({first, between, second}, 10.5, 36.5), 300);
  EXPECT_EQ(height({second, between, first}, 10.5, 36.5), 200);
  EXPECT_EQ(height({second, between, first}, 3.5, 36.5), 300);
  EXPECT_EQ(height({second, between, first}, 1.5, 36.5), 100);
  // Its neighbours count although they come later.
  EXPECT_NEAR(height({first, between, second}, 7.75, 36.5), 125, 1);
}

TEST_F(JoinedGrids, PixelsAreReadAlikeInAnyWindow) {
  SCOPED_TRACE("seed " + std::to_string(seed_));
  const RasterFixture whole = rough_raster(dice_, 50, 40);
  SourcePool pool = pool_of(cut_files(whole, 8, false));
  GridPixels pixels(pool);
  ASSERT_EQ(pixels.grid_of(0), pixels.grid_of(pool.size() - 1));
  EXPECT_EQ(pixels.last_raster(0), pool.size() - 1);
  for (int turn = 0; turn < 100; ++turn) {
    PixelWindow window{.column0 = static_cast<std::int64_t>(pick(0, 49)),
                       .row0 = static_cast<std::int64_t>(pick(0, 39))};
    window.width =
        static_cast<std::int64_t>(pick(1, static_cast<std::size_t>(50 - window.column0)));
    window.height = static_cast<std::int64_t>(pick(1, static_cast<std::size_t>(40 - window.row0)));
    const std::int64_t stride = window.width + static_cast<std::int64_t>(pick(0, 2));
    std::vector<double> out(static_cast<std::size_t>(stride * window.height), -1);
    pixels.read(pool, 0, pool.size() - 1, window, out, stride);
    for (std::int64_t r = 0; r < window.height; ++r) {
      for (std::int64_t c = 0; c < window.width; ++c) {
        const double expected =
            whole.value(static_cast<int>(window.column0 + c), static_cast<int>(window.row0 + r));
        const double found = out[static_cast<std::size_t>(r * stride + c)];
        const bool is_void = std::isnan(expected) || expected == -32768;
        ASSERT_TRUE(is_void ? std::isnan(found) : found == static_cast<float>(expected));
      }
    }
  }
}

}  // namespace
}  // namespace qmpipe::testing::joined_grids_test
