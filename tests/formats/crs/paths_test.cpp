// The texts of a CRS that name files, in every spelling that PROJ takes, and those that name none.
#include "formats/crs/paths.h"

#include <cpl_conv.h>
#include <cpl_string.h>
#include <gtest/gtest.h>
#include <ogr_spatialref.h>

#include <algorithm>
#include <array>
#include <random>
#include <string>
#include <vector>

#include "formats/crs/foreign.h"

namespace qmpipe::paths_test {
namespace {

constexpr int kCases = 2000;

class Dice {
 public:
  explicit Dice(std::uint64_t seed) : random_(seed) {}
  bool flip() { return random_() % 2 == 0; }
  template <class List>
  const auto& any_of(const List& list) {
    return list[random_() % list.size()];
  }
  // Keywords count in any case.
  std::string spelled(std::string word) {
    for (char& c : word) {
      if (flip()) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    }
    return word;
  }
  std::string blanks() {
    static const std::vector<std::string> kBlanks = {"", "", " ", "\n", " \t "};
    return any_of(kBlanks);
  }
  std::uint64_t number() { return random_(); }

 private:
  std::mt19937_64 random_;
};

const std::vector<std::string> kPaths = {
    "/tmp/fifo", "./fifo", "../a/fifo", "sub/fifo", "~/fifo", "C:\\fifo", "http://127.0.0.1/g.tif",
    "/dev/zero"};
const std::vector<std::string> kBareNames = {"ntf_r93.gsb", "@null", "egm96_15.gtx",
                                             "us_noaa_conus.tif", "null"};

// A PROJ string with `name` as a file of it.
std::string proj_string(Dice& dice, const std::string& name, bool is_in_wkt) {
  static const std::vector<std::string> kKeys = {"nadgrids", "geoidgrids", "grids", "xy_grids",
                                                 "z_grids",  "init",       "file",  "model"};
  const std::string key = dice.any_of(kKeys);
  std::string value = key == "init" ? name + ":1" : name;
  if (key != "init" && dice.flip()) value = "@null," + value;
  if (dice.flip()) value = (is_in_wkt ? "\"\"" : "\"") + value + (is_in_wkt ? "\"\"" : "\"");
  const std::string blank = dice.flip() ? " " : " \t";
  return "+proj=tmerc" + blank + "+lon_0=9" + blank + (dice.flip() ? "+" : "") + key + "=" + value +
         blank + "+no_defs";
}

std::string quoted(Dice& dice, const std::string& text) {
  return dice.flip() ? "\"" + text + "\"" : "\u201c" + text + "\u201d";
}

std::string wkt_with(Dice& dice, const std::string& name) {
  const std::string comma = dice.blanks() + "," + dice.blanks();
  const std::string open = dice.blanks() + (dice.flip() ? "[" : "(") + dice.blanks();
  std::string part;
  switch (dice.number() % 5) {
    case 0:
      part = dice.spelled("extension") + open + quoted(dice, dice.spelled("proj4_grids")) + comma +
             quoted(dice, name);
      break;
    case 1:
      part = dice.spelled("extension") + open + quoted(dice, dice.spelled("proj4")) + comma + "\"" +
             proj_string(dice, name, true) + "\"";
      break;
    case 2:
      part = dice.spelled("parameterfile") + open +
             quoted(dice, "Latitude and longitude difference file") + comma + quoted(dice, name);
      break;
    case 3:
      part = dice.spelled("method") + open + "\"PROJ defmodel model=" + name + "\"";
      break;
    default:
      part = dice.spelled("remark") + open + "\"PROJ CRS string: " + proj_string(dice, name, true) +
             "\"";
  }
  return "PROJCS[\"NAD83 / UTM zone 13N\",GEOGCS[\"a / b\"," + part + "]]]";
}

std::string json_with(Dice& dice, const std::string& name) {
  std::string in_json;
  for (const char c : name) in_json += c == '\\' ? "\\\\" : std::string(1, c);
  return "{\"type\": \"BoundCRS\", \"transformation\": {\"parameters\":" + dice.blanks() +
         "[{\"name\": \"a file\", \"value\":" + dice.blanks() + "\"" + in_json + "\"}]}}";
}

std::string crs_with(Dice& dice, const std::string& name) {
  switch (dice.number() % 3) {
    case 0:
      return dice.blanks() + proj_string(dice, name, false);
    case 1:
      return json_with(dice, name);
    default:
      return wkt_with(dice, name);
  }
}

TEST(CrsPaths, AreFoundInEverySpelling) {
  for (std::uint64_t seed = 1; seed <= kCases; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Dice dice(seed);
    const std::string text = crs_with(dice, dice.any_of(kPaths));
    EXPECT_TRUE(path_in_crs(text)) << text;
    EXPECT_TRUE(fault_of_foreign_crs(text)) << text;
  }
}

TEST(CrsPaths, AreNoBareNamesWhichProjSeeksInItsOwnFolders) {
  for (std::uint64_t seed = 1; seed <= kCases; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Dice dice(seed);
    const std::string text = crs_with(dice, dice.any_of(kBareNames));
    EXPECT_FALSE(path_in_crs(text)) << text << ": " << *path_in_crs(text);
  }
}

TEST(CrsPaths, AreFoundInElementsAttributesAndSectionsOfXml) {
  for (std::uint64_t seed = 1; seed <= kCases; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Dice dice(seed);
    const std::string crs = crs_with(dice, dice.any_of(kPaths));
    const CPLString escaped = CPLString(crs);
    char* const text = CPLEscapeString(escaped.c_str(), -1, CPLES_XML);
    const std::vector<std::string> documents = {
        "<VRTDataset><SRS dataAxisToSRSAxisMapping=\"1,2\">" + std::string(text) +
            "</SRS></VRTDataset>",
        "<?xml version=\"1.0\"?>\n<a><GCPList Projection=\"" + std::string(text) + "\"/></a>",
        "<PAMDataset><SRS><![CDATA[" + crs + "]]></SRS></PAMDataset>"};
    CPLFree(text);
    const std::string& document = dice.any_of(documents);
    EXPECT_TRUE(path_in_crs_of_xml(document)) << document;
  }
}

// Of what surveys are in; their names hold slashes.
TEST(CrsPaths, AreNamedByNoCrsOfTheRegister) {
  const std::array<int, 12> codes = {4326,  3857, 32632, 26913, 2056, 28992,
                                     27700, 2154, 3031,  7415,  5514, 6340};
  const std::array<const char*, 5> formats = {"WKT1", "WKT1_ESRI", "WKT2_2015", "WKT2_2019", ""};
  for (const int code : codes) {
    OGRSpatialReference crs;
    ASSERT_EQ(crs.importFromEPSG(code), OGRERR_NONE);
    for (const char* const format : formats) {
      const std::string option = "FORMAT=" + std::string(format);
      const std::array<const char*, 2> options = {option.c_str(), nullptr};
      char* text = nullptr;
      if (*format != '\0') {
        crs.exportToWkt(&text, options.data());
      } else {
        crs.exportToPROJJSON(&text, nullptr);
      }
      ASSERT_NE(text, nullptr);
      EXPECT_FALSE(path_in_crs(text)) << text;
      CPLFree(text);
    }
  }
}

TEST(CrsPaths, AreNotSoughtInWhatTellsOfCommands) {
  // As software writes it into its files, between numbers.
  constexpr std::array kHistory = std::to_array(
      "\0\0\0\x0chistory\0gdalwarp -s_srs \"+proj=longlat +nadgrids=/home/me/a.gsb\" a b");
  const std::string history(kHistory.data(), kHistory.size());
  EXPECT_FALSE(path_in_crs(history));
  EXPECT_FALSE(path_in_crs("ncols 3\nnrows 4\n1 2 3"));
  EXPECT_FALSE(path_in_crs(""));
}

TEST(CrsPaths, AreSoughtInAnyBytes) {
  const std::string marks = "\"\"''<>&;[](),:=+~/\\{}@ \n\0proj4_grids";
  for (std::uint64_t seed = 1; seed <= kCases; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Dice dice(seed);
    std::string text = crs_with(dice, dice.any_of(kPaths));
    for (int k = 0; k < 6; ++k) text[dice.number() % text.size()] = dice.any_of(marks);
    text.resize(dice.number() % (text.size() + 1));
    for (const auto& found : {path_in_crs(text), path_in_crs_of_xml("<a>" + text)}) {
      EXPECT_TRUE(!found || found->find_first_of("/\\~") != std::string::npos) << text;
    }
  }
}

}  // namespace
}  // namespace qmpipe::paths_test
