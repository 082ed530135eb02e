// Rasters that cannot be placed, each refused with the remedy that works, and those that only seem so.
#include "formats/raster/plane.h"

#include <gdal_priv.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "formats/bytes/errors.h"
#include "tests/support/raster_fixture.h"

namespace qmpipe::testing::plane_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

template <class Refusal>
std::string refusal_in(const std::string& path, const OpenOptions& options) {
  try {
    RasterSource::open(path, options);
  } catch (const Refusal& error) {
    return error.what();
  } catch (const std::runtime_error& error) {
    ADD_FAILURE() << "another error: " << error.what();
    return error.what();
  }
  ADD_FAILURE() << path << " was opened";
  return "";
}

TEST(SourceCrs, OfHeightsAloneOrOfTheEarthsCentreIsRefused) {
  const TemporaryFolder folder;
  write_raster(file_in(folder, "a.tif"), {.crs = ""});
  for (const char* crs : {"EPSG:5773", "EPSG:3855", "EPSG:5715", "EPSG:4978"}) {
    SCOPED_TRACE(crs);
    for (const Placing placing : {Placing::kGlobe, Placing::kPlane}) {
      EXPECT_THAT(refusal_in<UsageError>(file_in(folder, "a.tif"),
                                         {.crs_override = crs, .placing = placing}),
                  AllOf(HasSubstr(crs), HasSubstr("--source-crs EPSG:4326+5773")));
    }
  }
  // The line that it names.
  const auto source =
      RasterSource::open(file_in(folder, "a.tif"), {.crs_override = "EPSG:4326+5773"});
  EXPECT_EQ(source->pixel_at(12, 49)->column, 2);
  EXPECT_EQ(source->info().band.vertical_name, "EGM96 height");
}

TEST(SourceCrs, DegreesThatThereAreNotAreRefused) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 10, .height = 10, .crs = ""};
  fixture.geotransform = {{779236, 100, 0, 5621521, 0, -100}};
  const std::string path = file_in(folder, "a.tif");
  write_raster(path, fixture);
  for (const char* crs : {"EPSG:4326", "OGC:CRS84", "EPSG:4258", "EPSG:4807"}) {
    for (const Placing placing : {Placing::kGlobe, Placing::kPlane}) {
      EXPECT_THAT(
          refusal_in<UsageError>(path, {.crs_override = crs, .placing = placing}),
          AllOf(HasSubstr(crs), HasSubstr("no degrees"), HasSubstr("--source-crs EPSG:32632")));
    }
  }
  RasterSource::open(path, {.crs_override = "EPSG:32632"});
  fixture.crs = "EPSG:4326";
  write_raster(path, fixture);
  EXPECT_THAT(refusal_in<IoError>(path, {}), HasSubstr("no degrees"));
}

TEST(SourceCrs, DegreesOfCoarseGridsAndOfAllWaysToCountAreTaken) {
  const TemporaryFolder folder;
  for (const auto& [x0, y0, step] : {std::tuple{-180.0, 90.0, 5.0},
                                     {0.0, 90.0, 10.0},
                                     {-2.5, 92.5, 5.0},
                                     {-182.5, 92.5, 5.0},
                                     {180.0, 90.0, 5.0}}) {
    SCOPED_TRACE(x0);
    const int columns = static_cast<int>(360 / step);
    const int rows = static_cast<int>((2 * y0) / step);
    RasterFixture fixture{.width = columns, .height = rows};
    fixture.geotransform = {{x0, step, 0, y0, 0, -step}};
    write_raster(file_in(folder, "a.tif"), fixture);
    RasterSource::open(file_in(folder, "a.tif"));
  }
}

TEST(OtherBodies, AreRefusedWithoutAnEarthCrsAsTheRemedy) {
  const TemporaryFolder folder;
  for (const char* crs :
       {"+proj=longlat +R=3396190 +no_defs", "+proj=longlat +R=1737400 +no_defs",
        "+proj=eqc +R=1737400 +no_defs", "+proj=stere +lat_0=90 +R=3376200 +no_defs",
        "+proj=longlat +a=6051800 +b=6051800 +no_defs"}) {
    SCOPED_TRACE(crs);
    RasterFixture fixture{.crs = ""};
    const std::string path = file_in(folder, "a.tif");
    write_raster(path, fixture);
    const std::string refusal = refusal_in<IoError>(path, {.crs_override = crs});
    EXPECT_THAT(refusal, AllOf(HasSubstr("another body"), HasSubstr("radius"), HasSubstr("tin"),
                               Not(HasSubstr("EPSG")), Not(HasSubstr("--source-crs"))));
    const bool is_geographic = std::string(crs).find("longlat") != std::string::npos;
    if (is_geographic) {
      EXPECT_THAT(refusal_in<IoError>(path, {.crs_override = crs, .placing = Placing::kPlane}),
                  AllOf(HasSubstr("+proj=eqc +R="), Not(HasSubstr("EPSG"))));
    } else {
      // Heights that Earth does not have are none of our business there.
      fixture.value = [](int, int) { return 21000; };
      write_raster(path, fixture);
      const auto source =
          RasterSource::open(path, {.crs_override = crs,
                                    .tally = std::make_shared<HeightTally>(HeightGuard::kStop),
                                    .placing = Placing::kPlane});
      EXPECT_EQ(read_all(*source)[0], 21000);
    }
  }
  for (const char* crs : {"+proj=longlat +R=6371000", "+proj=longlat +ellps=clrk66",
                          "+proj=eqc +R=6378137", "+proj=longlat +ellps=evrst30"}) {
    SCOPED_TRACE(crs);
    write_raster(file_in(folder, "a.tif"), {.crs = ""});
    RasterSource::open(file_in(folder, "a.tif"), {.crs_override = crs});
  }
}

void write_vrt(const std::string& path, const std::string& source, const std::string& inside) {
  std::ofstream(path) << "<VRTDataset rasterXSize=\"4\" rasterYSize=\"3\">" << inside
                      << "<VRTRasterBand dataType=\"Float32\" band=\"1\"><SimpleSource>"
                         "<SourceFilename>"
                      << source
                      << "</SourceFilename><SourceBand>1</SourceBand></SimpleSource>"
                         "</VRTRasterBand></VRTDataset>";
}

TEST(PlacedByPoints, TheRemedyComesBeforeAnyTalkOfACrs) {
  const TemporaryFolder folder;
  const std::string source = file_in(folder, "a.tif");
  write_raster(source, {.geotransform = std::nullopt, .crs = ""});
  const std::string gcp =
      "<GCP Pixel=\"0\" Line=\"0\" X=\"7\" Y=\"45\"/>"
      "<GCP Pixel=\"4\" Line=\"0\" X=\"7.4\" Y=\"45\"/>"
      "<GCP Pixel=\"0\" Line=\"3\" X=\"7\" Y=\"44\"/>";
  struct Case {
    std::string inside;
    std::string remedy;
  };
  for (const Case& one :
       {Case{"<GCPList Projection=\"EPSG:4326\">" + gcp + "</GCPList>", "gdalwarp -t_srs"},
        Case{"<GCPList>" + gcp + "</GCPList>", "gdalwarp -s_srs EPSG:n -t_srs"},
        Case{"<Metadata domain=\"GEOLOCATION\"><MDI key=\"X_DATASET\">a</MDI></Metadata>",
             "gdalwarp -geoloc"},
        Case{"<Metadata domain=\"RPC\"><MDI key=\"LINE_OFF\">1</MDI></Metadata>",
             "gdalwarp -rpc"}}) {
    SCOPED_TRACE(one.remedy);
    write_vrt(file_in(folder, "a.vrt"), source, one.inside);
    for (const Placing placing : {Placing::kGlobe, Placing::kPlane}) {
      for (const char* crs : {"", "EPSG:4326"}) {
        EXPECT_THAT(refusal_in<IoError>(file_in(folder, "a.vrt"),
                                        {.crs_override = crs, .placing = placing}),
                    AllOf(HasSubstr(one.remedy), Not(HasSubstr("--source-crs"))));
      }
    }
  }
}

// Heights are 100 per row of y and 1 per column of x, whichever way the axes run.
void write_netcdf(const std::string& path, const std::vector<double>& x,
                  const std::vector<double>& y, const char* unit) {
  GDALAllRegister();
  std::filesystem::remove(path);
  const std::unique_ptr<GDALDataset> file(
      GetGDALDriverManager()->GetDriverByName("netCDF")->CreateMultiDimensional(path.c_str(),
                                                                                nullptr, nullptr));
  ASSERT_TRUE(file);
  const auto root = file->GetRootGroup();
  const auto across = root->CreateDimension("x", "", "", x.size());
  const auto down = root->CreateDimension("y", "", "", y.size());
  const auto number = GDALExtendedDataType::Create(GDT_Float64);
  const auto write = [](GDALMDArray& array, const std::vector<double>& values) {
    std::vector<GUInt64> start(array.GetDimensionCount(), 0);
    std::vector<std::size_t> count;
    for (const auto& dimension : array.GetDimensions()) count.push_back(dimension->GetSize());
    ASSERT_TRUE(array.Write(start.data(), count.data(), nullptr, nullptr, array.GetDataType(),
                            values.data()));
  };
  for (const auto& [dimension, values] : {std::pair{across, &x}, {down, &y}}) {
    const auto axis = root->CreateMDArray(dimension->GetName(), {dimension}, number);
    axis->SetUnit(unit);
    write(*axis, *values);
  }
  std::vector<double> heights;
  for (const double row : y) {
    for (const double column : x) heights.push_back(row * 100 + column);
  }
  write(*root->CreateMDArray("dem", {down, across}, number), heights);
}

TEST(NetcdfWithoutCrs, LiesAsItsAxesSay) {
  const TemporaryFolder folder;
  std::vector<double> up;
  std::vector<double> y_up;
  for (int k = 0; k < 12; ++k) up.push_back(500000 + 30.0 * k);
  for (int k = 0; k < 9; ++k) y_up.push_back(4900000 + 30.0 * k);
  const std::vector<double> down(up.rbegin(), up.rend());
  const std::vector<double> y_down(y_up.rbegin(), y_up.rend());
  int number = 0;
  for (const std::vector<double>& x : {up, down}) {
    for (const std::vector<double>& y : {y_up, y_down}) {
      SCOPED_TRACE(++number);
      const std::string path = file_in(folder, std::to_string(number) + ".nc");
      write_netcdf(path, x, y, "m");
      EXPECT_THAT(refusal_in<IoError>(path, {}), HasSubstr("--source-crs"));
      for (const Placing placing : {Placing::kGlobe, Placing::kPlane}) {
        const auto source =
            RasterSource::open(path, {.crs_override = "EPSG:32631", .placing = placing});
        const RasterInfo& info = source->info();
        ASSERT_EQ(info.width, 12);
        ASSERT_EQ(info.height, 9);
        const std::vector<double> heights = read_all(*source);
        for (int r = 0; r < 9; ++r) {
          for (int c = 0; c < 12; ++c) {
            const MapPoint at = info.plane.map_of({.column = c + 0.5, .row = r + 0.5});
            EXPECT_NEAR(heights[static_cast<std::size_t>(r * 12 + c)], at.y * 100 + at.x, 1);
          }
        }
      }
    }
  }
}

TEST(NetcdfWithoutCrs, OfTheFaultsIsNotTurnedRound) {
  const auto data = real_data("faults/nc_proj_topdown.nc");
  if (!data) GTEST_SKIP() << "no real data (set QMPIPE_DATA)";
  const auto source = RasterSource::open(*data, {.crs_override = "EPSG:32631"});
  EXPECT_LT(source->info().plane.y_per_row, 0);
  EXPECT_NEAR(read_all(*source)[0], 567.144, 0.001);
}

}  // namespace
}  // namespace qmpipe::testing::plane_test
