// A point cloud in memory, from LAS 1.0 to 1.4 or text, on a grid as the detail-increment model wants it.
//
// Guarantees: no two points have the same x and y, and the least x and y are 0; the points depend on
// the set in the file and on the options, not on the file's order. A LAS file whose x and y have the
// same step in metres keeps its integers but for a shift. Memory grows with the points that are kept:
// 24 bytes each while they are read and 12 afterwards; a text's are all kept until they are thinned.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "formats/detail_model/data.h"

namespace qmpipe {

struct PointReadOptions {
  // Classes of a LAS file to keep. DEFAULT: all but noise (7, and 18 in point formats 6 to 10).
  std::vector<std::uint8_t> classes = {};
  // Of each square of this many metres keep the point that is nearest to its centre: unlike the lowest
  // or the highest it takes no side, and what is left is spaced evenly. DEFAULT: 0, all.
  double thin_m = 0;
  // Leave out a point that is this many metres above or below all the others around it (at least
  // three, within some 36). DEFAULT: 0, none, because a mast or a sharp peak is such a point too.
  double outlier_m = 0;
  // Anything GDAL understands as a CRS. DEFAULT: empty, what the file says.
  std::string source_crs = {};
};

// What became of the points of the file; those that are left are the cloud's.
struct PointCounts {
  std::uint64_t in_file = 0;
  std::uint64_t withheld = 0;     // marked as deleted
  std::uint64_t noise = 0;        // classified as such, and no classes were asked for
  std::uint64_t other_class = 0;  // than those asked for
  std::uint64_t non_finite = 0;
  std::uint64_t thinned = 0;
  std::uint64_t off_grid = 0;    // too far from the others for the grid
  std::uint64_t same_place = 0;  // where several have the same x and y, the lowest is kept
  std::uint64_t outliers = 0;
};

struct PointCloud {
  std::vector<DetailPoint> points;  // by x, then y
  // Steps and offset in metres, so place() is the file's coordinate times units_m, for each axis.
  DetailFrame frame;
  // Metres in one unit of the file's x, y, z. In degrees: at the middle latitude, on WGS84.
  std::array<double, 3> units_m = {1, 1, 1};
  std::string crs_wkt;   // of x and y; empty: unknown
  std::string crs_name;  // likewise
  PointCounts counts;
  // What had to be assumed, as sentences without a full stop.
  std::vector<std::string> assumptions;
};

// Does the name's extension or the file's beginning say that points are in it? .las .laz, LASF, and .xyz
// .csv .txt unless it is an ASCII grid ("ncols"). Other files may be rasters.
bool is_point_file(const std::filesystem::path& path);

// By the extension, else by the first bytes: LASF, or text. Throws IoError, with the remedy, for a
// file that is damaged, cut off, compressed, or from which fewer than three points are left, and for
// points that are spread too widely for the grid; UsageError for classes of a text and for a
// source_crs that is none. REQUIRES: thin_m and outlier_m finite, not negative.
PointCloud read_point_cloud(const std::filesystem::path& path, const PointReadOptions& options);

// "ground" (2) and numbers 0..255 between commas, sorted. Throws UsageError.
std::vector<std::uint8_t> parse_point_classes(const std::string& text);

// "7 at the same x and y as a lower one, 2 marked as withheld": what was left out; empty if nothing.
std::string left_out(const PointCounts& counts);

}  // namespace qmpipe
