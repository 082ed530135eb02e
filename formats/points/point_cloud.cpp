#include "formats/points/point_cloud.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <numbers>
#include <string_view>
#include <utility>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"
#include "formats/bytes/letter_case.h"
#include "formats/crs/wgs84.h"
#include "formats/points/las_file.h"
#include "formats/points/point_crs.h"
#include "formats/points/point_grid.h"
#include "formats/points/point_text.h"
#include "scheduler/check.h"
#include "scheduler/elementary.h"

namespace qmpipe {
namespace {

namespace fs = std::filesystem;

constexpr char kWhatFailed[] = "cannot read the points of";
constexpr std::size_t kTextBytesAtOnce = 1 << 20;
// Of the point format, whose upper bits LAZ sets.
constexpr std::size_t kLasFormatAt = 104;
// Degrees need as many for steps of about a centimetre in whatever digits the text is written.
constexpr int kLeastDecimalsOfDegrees = 7;

[[noreturn]] void refuse(const fs::path& path, const std::string& cause,
                         const std::string& remedy) {
  throw IoError(kWhatFailed, path.string(), cause, remedy);
}

[[noreturn]] void refuse_compressed(const fs::path& path) {
  refuse(path, "its points are compressed (LAZ), which qmpipe does not read",
         "unpack it with: laszip -i IN.laz -o OUT.las, or: pdal translate IN.laz OUT.las");
}

std::string extension_of(const fs::path& path) { return lower_case(path.extension().string()); }

bool is_text_name(const std::string& extension) {
  return extension == ".xyz" || extension == ".csv" || extension == ".txt";
}

std::vector<std::uint8_t> first_bytes(const fs::path& path, std::size_t most) {
  std::error_code ignored;
  const std::uintmax_t size = fs::file_size(path, ignored);
  if (ignored) return {};
  auto bytes =
      read_file_range(path, 0, static_cast<std::size_t>(std::min<std::uintmax_t>(size, most)));
  return bytes ? std::move(*bytes) : std::vector<std::uint8_t>{};
}

bool begins_like_las(const fs::path& path) {
  const std::vector<std::uint8_t> bytes = first_bytes(path, kLasSignature.size());
  return std::equal(bytes.begin(), bytes.end(), kLasSignature.begin(), kLasSignature.end());
}

bool begins_like_text(const fs::path& path) {
  const std::vector<std::uint8_t> bytes = first_bytes(path, 4096);
  return !bytes.empty() && std::none_of(bytes.begin(), bytes.end(), [](std::uint8_t byte) {
    return byte < 32 && byte != '\t' && byte != '\n' && byte != '\r';
  });
}

// The rasters among the texts.
bool begins_like_ascii_grid(const fs::path& path) {
  constexpr std::string_view kFirstWord = "ncols";
  std::vector<std::uint8_t> bytes = first_bytes(path, kFirstWord.size());
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(std::tolower(byte));
  return std::equal(bytes.begin(), bytes.end(), kFirstWord.begin(), kFirstWord.end());
}

ByteSource source_of(const fs::path& path) {
  std::error_code error;
  const std::uintmax_t size = fs::file_size(path, error);
  if (error) refuse(path, error.message(), "check its name and its permissions");
  return {.size_bytes = size, .read = [path](std::uint64_t offset, std::size_t bytes) {
            return read_file_range(path, offset, bytes);
          }};
}

// The unit of x and y in metres. `latitudes`: the least and the greatest y of a geographic CRS.
std::array<double, 3> units_of(const fs::path& path, const RasterCrs& crs,
                               const std::array<double, 2>& latitudes) {
  const double height_m = metres_per_height_unit(crs);
  if (!crs.is_geographic) return {crs.metres_per_unit, crs.metres_per_unit, height_m};
  const double degrees = 360 / crs.turn;
  const double reach_deg = std::max(std::abs(latitudes[0]), std::abs(latitudes[1])) * degrees;
  if (!(reach_deg <= 90)) {
    refuse(path, fmt::format("its points reach to a latitude of {:g} degrees", reach_deg),
           "name the right CRS with --source-crs EPSG:n");
  }
  const double middle_deg = (latitudes[0] + latitudes[1]) / 2 * degrees;
  constexpr double kRadians = std::numbers::pi / 180;
  const auto [across_m, along_m] = curvature_radii(middle_deg);
  return {degrees * kRadians * across_m * cos_deg(middle_deg), degrees * kRadians * along_m,
          height_m};
}

PointCloud cloud_in(const RasterCrs& crs) {
  PointCloud cloud;
  cloud.crs_wkt = crs.text.wkt;
  cloud.crs_name = crs.name;
  cloud.assumptions = crs.assumptions;
  if (crs.vertical.points_down) {
    cloud.assumptions.push_back("the axis of '" + crs.vertical.name +
                                "' points down, but heights of points are taken upwards");
  }
  if (crs.vertical.unit.empty() && !crs.is_geographic && crs.metres_per_unit != 1) {
    cloud.assumptions.push_back(
        fmt::format("the CRS says nothing about heights; they are taken in its unit of x and y,"
                    " {:g} m",
                    crs.metres_per_unit));
  }
  return cloud;
}

// Neighbours around the poles are no plane, and a square there would be endless in degrees.
std::array<double, 2> square_sides(const fs::path& path, const PointCloud& cloud, double thin_m) {
  const std::array<double, 2> side = {thin_m / cloud.units_m[0], thin_m / cloud.units_m[1]};
  if (!(std::isfinite(side[0]) && std::isfinite(side[1]) && side[0] > 0 && side[1] > 0)) {
    refuse(path, fmt::format("its points cannot be thinned to squares of {:g} m", thin_m),
           "choose squares of another size with --thin");
  }
  return side;
}

// Counts and tells whether the point is one to keep.
bool is_wanted(const LasPoint& point, const PointReadOptions& options, PointCounts& counts) {
  ++counts.in_file;
  if (point.is_withheld) {
    ++counts.withheld;
    return false;
  }
  if (options.classes.empty()) {
    if (point.is_noise) ++counts.noise;
    return !point.is_noise;
  }
  const bool is_asked_for = std::find(options.classes.begin(), options.classes.end(),
                                      point.classification) != options.classes.end();
  if (!is_asked_for) ++counts.other_class;
  return is_asked_for;
}

void check(const fs::path& path, const std::optional<Error>& error) {
  if (error) refuse(path, error->message, "check the copy, or get the file anew");
}

// The least and the greatest y of the points to keep: a pass of its own, because what a header says
// of the file's extent need not be true, and the width of a degree hangs on it.
std::array<double, 2> latitudes_of(const fs::path& path, const ByteSource& source,
                                   const LasHeader& header, const PointReadOptions& options) {
  std::array<double, 2> range = {0, 0};
  bool is_first = true;
  PointCounts ignored;
  check(path, for_each_las_point(source, header, [&](const LasPoint& point) {
          if (!is_wanted(point, options, ignored)) return;
          const double y = header.offset[1] + header.scale[1] * point.at[1];
          range = is_first ? std::array{y, y}
                           : std::array{std::min(range[0], y), std::max(range[1], y)};
          is_first = false;
        }));
  return range;
}

PointCloud finished(const fs::path& path, RawPoints raw, const PointReadOptions& options,
                    PointCloud cloud) {
  if (const auto error = put_on_grid(std::move(raw), options.outlier_m, cloud)) {
    refuse(
        path, error->message,
        "remove the points that are far off, or write it with coarser steps: pdal translate IN.las "
        "OUT.las --writers.las.scale_x=0.01 --writers.las.scale_y=0.01");
  }
  if (cloud.points.size() < 3) {
    const std::string why = left_out(cloud.counts);
    refuse(path,
           fmt::format("{} of its {} points are left, too few for a surface{}", cloud.points.size(),
                       cloud.counts.in_file, why.empty() ? "" : "; " + why),
           "keep other classes, thin or clean less, or take another file");
  }
  return cloud;
}

PointCloud read_las(const fs::path& path, const PointReadOptions& options) {
  const ByteSource source = source_of(path);
  const std::vector<std::uint8_t> start = first_bytes(path, kLasFormatAt + 1);
  if (begins_like_las(path) && start.size() > kLasFormatAt && start[kLasFormatAt] >= 64) {
    refuse_compressed(path);
  }
  const auto header = read_las_header(source);
  if (!header) check(path, header.error());
  const RasterCrs crs = crs_of_points(path.string(), header->crs, options.source_crs);
  PointCloud cloud = cloud_in(crs);
  cloud.units_m = units_of(path, crs,
                           crs.is_geographic ? latitudes_of(path, source, *header, options)
                                             : std::array<double, 2>{0, 0});
  RawPoints raw{.values = {}, .step = header->scale, .offset = header->offset};
  std::optional<SquareThinner> thinner;
  if (options.thin_m > 0) thinner.emplace(raw, square_sides(path, cloud, options.thin_m));
  check(path, for_each_las_point(source, *header, [&](const LasPoint& point) {
          if (!is_wanted(point, options, cloud.counts)) return;
          const PointPlace value = {static_cast<double>(point.at[0]),
                                    static_cast<double>(point.at[1]),
                                    static_cast<double>(point.at[2])};
          if (!thinner) {
            raw.values.push_back(value);
          } else if (thinner->add(value)) {
            ++cloud.counts.thinned;
          }
        }));
  return finished(path, std::move(raw), options, std::move(cloud));
}

TextPoints parse_text_file(const fs::path& path) {
  const ByteSource source = source_of(path);
  PointTextParser parser;
  for (std::uint64_t at = 0; at < source.size_bytes;) {
    const auto count =
        static_cast<std::size_t>(std::min<std::uint64_t>(kTextBytesAtOnce, source.size_bytes - at));
    const auto bytes = source.read(at, count);
    if (!bytes) check(path, bytes.error());
    if (const auto error = parser.feed(*bytes)) {
      refuse(path, error->message, "write x, y and z in columns, with decimal points");
    }
    at += count;
  }
  auto points = parser.finish();
  if (!points) {
    refuse(path, points.error().message, "write x, y and z in columns, with decimal points");
  }
  return std::move(*points);
}

PointCloud read_text(const fs::path& path, const PointReadOptions& options) {
  if (!options.classes.empty()) {
    throw UsageError("--class: " + path.string() +
                     " is text, whose points have no class; leave it out, or give a LAS file");
  }
  TextPoints text = parse_text_file(path);
  const RasterCrs crs = crs_of_points(path.string(), {}, options.source_crs);
  PointCloud cloud = cloud_in(crs);
  cloud.counts.in_file = text.read;
  cloud.counts.non_finite = text.non_finite;
  RawPoints raw{.values = std::move(text.at)};
  std::array<double, 2> latitudes = {0, 0};
  if (crs.is_geographic && !raw.values.empty()) {
    latitudes = {raw.values.front()[1], raw.values.front()[1]};
    for (const PointPlace& p : raw.values) {
      latitudes = {std::min(latitudes[0], p[1]), std::max(latitudes[1], p[1])};
    }
  }
  cloud.units_m = units_of(path, crs, latitudes);
  if (options.thin_m > 0) {
    const std::vector<PointPlace> all = std::exchange(raw.values, {});
    SquareThinner thinner(raw, square_sides(path, cloud, options.thin_m));
    for (const PointPlace& p : all) {
      if (thinner.add(p)) ++cloud.counts.thinned;
    }
  }
  if (crs.is_geographic) {
    text.decimals[0] = std::max(text.decimals[0], kLeastDecimalsOfDegrees);
  }
  // A metre or so in either.
  round_to_decimals(raw, text.decimals, crs.is_geographic ? 1e5 : 1);
  return finished(path, std::move(raw), options, std::move(cloud));
}

}  // namespace

bool is_point_file(const fs::path& path) {
  const std::string extension = extension_of(path);
  if (is_text_name(extension)) return !begins_like_ascii_grid(path);
  return extension == ".las" || extension == ".laz" || begins_like_las(path);
}

PointCloud read_point_cloud(const fs::path& path, const PointReadOptions& options) {
  for (const double option : {options.thin_m, options.outlier_m}) {
    QMPIPE_CHECK(std::isfinite(option) && option >= 0);
  }
  const std::string extension = extension_of(path);
  if (extension == ".laz") refuse_compressed(path);
  if (extension == ".las") return read_las(path, options);
  if (is_text_name(extension)) return read_text(path, options);
  if (begins_like_las(path)) return read_las(path, options);
  if (begins_like_text(path)) return read_text(path, options);
  source_of(path);  // says so when it is not there
  refuse(path, "it is neither LAS nor text",
         "give a .las file, or text with x, y and z in columns");
}

std::vector<std::uint8_t> parse_point_classes(const std::string& text) {
  std::vector<std::uint8_t> classes;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string name = text.substr(begin, end - begin);
    std::uint8_t number = 2;
    const auto read = std::from_chars(name.data(), name.data() + name.size(), number);
    const bool is_number = read.ec == std::errc() && read.ptr == name.data() + name.size();
    if (!is_number && name != "ground") {
      throw UsageError(
          fmt::format("--class {}: '{}' is no class; write ground, or numbers from 0 to"
                      " 255 between commas",
                      text, name));
    }
    classes.push_back(number);
    begin = end + 1;
  }
  std::sort(classes.begin(), classes.end());
  classes.erase(std::unique(classes.begin(), classes.end()), classes.end());
  return classes;
}

std::string left_out(const PointCounts& counts) {
  std::string text;
  const auto add = [&](std::uint64_t count, const char* what) {
    if (count > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, what);
  };
  add(counts.withheld, "marked as withheld");
  add(counts.noise, "classified as noise");
  add(counts.other_class, "of other classes");
  add(counts.non_finite, "with a coordinate that is no finite number");
  add(counts.thinned, "thinned out");
  add(counts.off_grid, "too far from all others");
  add(counts.same_place, "at the same x and y as a lower one");
  add(counts.outliers, "far above or below all around them");
  return text;
}

}  // namespace qmpipe
