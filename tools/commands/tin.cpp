#include "tools/commands/tin.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "formats/bytes/errors.h"
#include "formats/bytes/folders.h"
#include "formats/bytes/printable.h"
#include "pipeline/common/process_memory.h"
#include "pipeline/common/stopwatch.h"
#include "pipeline/tin/single_tin.h"
#include "tools/arguments/heights.h"
#include "tools/arguments/help_format.h"
#include "tools/arguments/method.h"
#include "tools/arguments/parse_values.h"
#include "tools/arguments/pyramid.h"

namespace qmpipe {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kTinFooter =
    "Without --tolerance and --triangles the method's parameters decide. Their defaults here are\n"
    "those of Campos et al. 2020 for single DEMs (Table 2): g_e=5 g_g=0 e_e=2000 p_e=100 p_b=5\n"
    "p_m=10 r_r=98.5 d_g=1000 h_c=150 h_v=1e-4 w_p=1.5 w_r=25 w_i=15; of a series by zoom the\n"
    "value at zoom 0 counts. Unless they are given, p_e is the tolerance with --tolerance, and\n"
    "h_v is 1/3 with --triangles, so that h_c alone decides.\n"
    "Voids are left out of the mesh; errors are those of valid posts. Same input, same bytes.\n"
    "An existing MESH is replaced.\n"
    "\n"
    "Examples:\n"
    "  qmpipe tin dem.tif -o dem.ply --tolerance 2\n"
    "  qmpipe tin dem.tif -o dem.glb --triangles 50000 --method edge-collapse --json\n"
    "Exit codes: 0 written, 1 failed, 2 wrong usage or a target that cannot be met.";

// The words as typed, before they are understood.
struct TinArguments {
  std::string input;
  std::string output;
  std::string source_crs;
  HeightArguments heights;
  MethodArguments method;
  double tolerance_m = 0;
  bool tolerance_given = false;
  std::int64_t triangles = 0;
  bool triangles_given = false;
  std::string frame = "local";
  std::string memory = "0";
  bool wants_json = false;
  bool verbose = false;
};

struct Written {
  std::string path;
  std::uintmax_t bytes = 0;
  double write_s = 0;
};

SingleTinOptions to_options(const TinArguments& arguments) {
  const auto sets_tolerance = [](const std::string& text) { return text.starts_with("g_e="); };
  if ((arguments.tolerance_given || arguments.triangles_given) &&
      std::any_of(arguments.method.parameters.begin(), arguments.method.parameters.end(),
                  sets_tolerance)) {
    throw UsageError(
        "--param g_e is what --tolerance and --triangles decide; give one of the three");
  }
  SingleTinOptions options;
  ShortForms short_forms;
  if (arguments.tolerance_given) {
    options.target.tolerance_m = arguments.tolerance_m;
    short_forms.push_back({"--tolerance", "g_e", ZoomSeries({arguments.tolerance_m})});
    // Borders and sharp edges would else be coarser than the tolerance whatever is left of the rest.
    options.parameters.set("p_e", ZoomSeries({arguments.tolerance_m}));
  }
  if (arguments.triangles_given) {
    options.target.most_triangles = arguments.triangles;
    // Any value: clusters as large as it takes, however rough.
    options.parameters.set("h_v", ZoomSeries({1.0 / 3}));
  }
  const MethodChoice choice = to_choice(arguments.method, short_forms, options.parameters);
  options.input = arguments.input;
  options.source_crs = arguments.source_crs;
  options.heights = to_height_options(arguments.heights);
  options.guard = to_height_guard(arguments.heights);
  options.method = choice.method;
  options.stop = choice.stop;
  options.parameters = choice.parameters;
  options.memory_bytes = parse_size("--memory", arguments.memory);
  return options;
}

TinFrame to_frame(const TinArguments& arguments) {
  return is_local_frame(arguments.frame, mesh_format_of(arguments.output)) ? TinFrame::kLocal
                                                                           : TinFrame::kCrs;
}

void print_effective(const TinArguments& arguments, const SingleTinOptions& options) {
  const MethodChoice choice = {options.method, options.stop, options.parameters};
  std::string text = fmt::format(
      "effective options:\n  input          {}\n  output         {}\n  source-crs     {}\n"
      "  heights        {}\n  method         {}\n",
      options.input, arguments.output,
      options.source_crs.empty() ? "(the file's)" : options.source_crs,
      heights_text(options.heights), text_of(choice));
  text += effective_parameters(choice);
  if (options.target.tolerance_m) {
    text += fmt::format("  tolerance      {} m\n", *options.target.tolerance_m);
  }
  if (options.target.most_triangles) {
    text += fmt::format("  triangles      {} at most\n", *options.target.most_triangles);
  }
  text += fmt::format("  frame          {}\n  memory         {} bytes\n", arguments.frame,
                      memory_limit_bytes(options.memory_bytes));
  std::fputs(text.c_str(), stderr);
}

std::int64_t grid_triangles(const PostGrid& grid) {
  return 2 * std::int64_t{grid.width_posts - 1} * (grid.height_posts - 1);
}

// Valid posts that lie in triangles left out with the voids around them.
std::int64_t uncovered_posts(const SingleTin& single) {
  return static_cast<std::int64_t>(single.dem.post_count()) - single.dem.void_count -
         single.result.error.posts;
}

// The pixel of the worst post, column and row from 0.
std::array<std::int64_t, 2> worst_pixel(const SingleTin& single) {
  const PostGrid& grid = single.dem.grid;
  const Post& worst = single.result.error.worst;
  const PixelPoint at = single.dem.pixel_of(grid.u_exact.at(static_cast<std::size_t>(worst.i)),
                                            grid.v_exact.at(static_cast<std::size_t>(worst.j)));
  return {static_cast<std::int64_t>(at.column), static_cast<std::int64_t>(at.row)};
}

void print_text(const SingleTinOptions& options, const SingleTin& single, const Written& written) {
  const Dem& dem = single.dem;
  const TargetedTin& result = single.result;
  const std::size_t triangles = result.tin.triangle_count();
  const auto line = [](const char* name, const std::string& value) {
    fmt::print("{:<19}{}\n", name, value);
  };
  std::string values;
  for (const auto& [name, value] : result.values) values += fmt::format(" {}={:g}", name, value);
  line("mesh", fmt::format("{}, {} bytes", printable_line(written.path), written.bytes));
  line("DEM", fmt::format("{} x {} posts, {:.4g} x {:.4g} m apart, {:g} to {:g} m high",
                          dem.grid.width_posts, dem.grid.height_posts, post_spacing(dem.info).x_m,
                          post_spacing(dem.info).y_m, dem.low_m, dem.high_m));
  line("voids",
       fmt::format("{} posts, {} of them under triangles that are mostly valid; {} triangles left "
                   "out, {} valid posts with them",
                   dem.void_count, result.covered_voids, result.void_triangles,
                   uncovered_posts(single)));
  line("method", name_of(options.method) + values +
                     (result.attempts > 1 ? fmt::format(", found in {} attempts", result.attempts)
                                          : std::string()));
  line("vertices", std::to_string(result.tin.vertices.size()));
  line("triangles", fmt::format("{}, {:.3g} % of the full grid's", triangles,
                                100 * static_cast<double>(triangles) /
                                    static_cast<double>(grid_triangles(dem.grid))));
  const auto [column, row] = worst_pixel(single);
  line("largest error",
       fmt::format("{:.3f} m, at column {}, row {}", result.error.largest_m, column, row));
  line("mean error", fmt::format("{:.3f} m", result.error.mean_m()));
  line("RMS error", fmt::format("{:.3f} m", result.error.rms_m()));
  line("height step", fmt::format("{:g} m", result.height_step_m));
  line("time", fmt::format("reading {:.2f} s, simplifying {:.2f} s, writing {:.2f} s",
                           single.read_s, single.simplify_s, written.write_s));
  line("peak memory", fmt::format("{} bytes", peak_resident_bytes()));
}

void print_json(const SingleTinOptions& options, const SingleTin& single, const Written& written) {
  const Dem& dem = single.dem;
  const TargetedTin& result = single.result;
  const std::size_t triangles = result.tin.triangle_count();
  const PostSpacing spacing = post_spacing(dem.info);
  const Json document = {
      {"mesh", written.path},
      {"file_bytes", written.bytes},
      {"columns", dem.grid.width_posts},
      {"rows", dem.grid.height_posts},
      {"post_spacing_m", {spacing.x_m, spacing.y_m}},
      {"height_m", {dem.low_m, dem.high_m}},
      {"posts", dem.post_count()},
      {"void_posts", dem.void_count},
      {"covered_void_posts", result.covered_voids},
      {"void_triangles", result.void_triangles},
      {"uncovered_valid_posts", uncovered_posts(single)},
      {"method", name_of(options.method)},
      {"parameters", result.values},
      {"attempts", result.attempts},
      {"vertices", result.tin.vertices.size()},
      {"triangles", triangles},
      {"share_of_grid_triangles",
       static_cast<double>(triangles) / static_cast<double>(grid_triangles(dem.grid))},
      {"largest_error_m", result.error.largest_m},
      {"largest_error_pixel", worst_pixel(single)},
      {"mean_error_m", result.error.mean_m()},
      {"rms_error_m", result.error.rms_m()},
      {"height_step_m", result.height_step_m},
      {"seconds",
       {{"read", single.read_s}, {"simplify", single.simplify_s}, {"write", written.write_s}}},
      {"peak_memory_bytes", peak_resident_bytes()}};
  fmt::print("{}\n", document.dump(2, ' ', false, Json::error_handler_t::replace));
}

int run_tin(const TinArguments& arguments) {
  const TinFrame frame = to_frame(arguments);
  const SingleTinOptions options = to_options(arguments);
  require_folder_of(arguments.output, "cannot write the mesh");
  if (arguments.verbose) print_effective(arguments, options);
  const SingleTin single = make_single_tin(options);
  for (const std::string& assumption : single.dem.info.assumptions) {
    fmt::print(stderr, "qmpipe: {}: {}\n", printable_line(single.dem.info.path),
               printable_line(assumption));
  }
  const Stopwatch watch;
  write_mesh_file(arguments.output, mesh_of(single, frame));
  const double write_s = watch.seconds();
  const Written written{
      .path = arguments.output, .bytes = fs::file_size(arguments.output), .write_s = write_s};
  if (arguments.wants_json) {
    print_json(options, single, written);
  } else {
    print_text(options, single, written);
  }
  return 0;
}

void add_options(CLI::App& command, TinArguments& arguments) {
  begin_group(command, kQualityGroup);
  command
      .add_option("INPUT", arguments.input,
                  "Raster of any GDAL format, 2 x 2 to 32768 x 32768 pixels; each pixel is a post")
      ->required();
  command
      .add_option("-o,--output", arguments.output,
                  "Mesh to write; the name ends in .ply (binary, double), .obj (text), .glb "
                  "(float32, y up) or .stl (float32)")
      ->required()
      ->type_name("MESH");
  command
      .add_option("--tolerance", arguments.tolerance_m,
                  "Largest vertical error in metres. greedy and edge-collapse hold it; for the "
                  "point sets the coarsest r_r, d_g, h_c or w_p within it is searched")
      ->type_name("M");
  command
      .add_option("--triangles", arguments.triangles,
                  "At most so many triangles; for the point sets searched likewise")
      ->type_name("N");
  add_method_options(command, arguments.method);
  begin_group(command, kOutputGroup);
  command
      .add_option("--frame", arguments.frame,
                  "local: metres east and north of the DEM's middle, heights up; crs: the "
                  "coordinates of the CRS, heights in metres (.ply and .obj only)")
      ->capture_default_str()
      ->check(CLI::IsMember({"local", "crs"}));
  begin_group(command, kInputGroup);
  command
      .add_option("--source-crs", arguments.source_crs,
                  "CRS of the input, in place of its own (EPSG:32605, a .prj file, WKT). Without "
                  "any, coordinates are metres")
      ->type_name("CRS");
  add_height_options(command, arguments.heights);
  add_height_guard(command, arguments.heights);
  add_memory_option(command, arguments.memory);
  begin_group(command, kMessagesGroup);
  command.add_flag("--json", arguments.wants_json, "Print the statistics as JSON");
  command.add_flag("-v,--verbose", arguments.verbose, "Print every effective option first");
  command.footer(kTinFooter);
}

}  // namespace

void register_tin(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<TinArguments>();
  CLI::App* command = app.add_subcommand(
      "tin", "Turn one DEM into one TIN (.ply, .obj, .glb, .stl) by any method, with its errors");
  add_options(*command, *arguments);
  command->callback([arguments, command, &action] {
    arguments->tolerance_given = command->count("--tolerance") > 0;
    arguments->triangles_given = command->count("--triangles") > 0;
    action = [arguments] { return run_tin(*arguments); };
  });
}

}  // namespace qmpipe
