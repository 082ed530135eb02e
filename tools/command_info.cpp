#include "tools/command_info.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <string>
#include <system_error>

#include "formats/errors.h"
#include "formats/tile_path.h"
#include "tools/info_report.h"

namespace qmpipe {
namespace {

constexpr const char* kFooter =
    "Sizes are in bytes, heights in metres above the WGS84 ellipsoid, positions in metres.\n"
    "Exit code 1: layer.json is missing or damaged, or the tile is no valid tile.\n"
    "\n"
    "Examples:\n"
    "  qmpipe info out\n"
    "  qmpipe info out/10/1073/712.terrain --json\n"
    "  qmpipe info out/10/1073/712.terrain --mesh tile.glb";

struct InfoArguments {
  std::string path;
  bool wants_json = false;
  std::string mesh_path;
  std::string frame = "enu";
  std::string key;
  std::string projection;
};

TileKey parse_key(const std::string& text) {
  const std::optional<TileKey> key = parse_tile_path(text + std::string(kTileExtension));
  if (key && to_string(*key) == text) return *key;
  throw UsageError(
      fmt::format("--key {}: write it as zoom/x/y with y from the south, e.g. 10/3/7", text));
}

bool is_tile_set(const std::filesystem::path& path) {
  std::error_code code;
  return std::filesystem::is_directory(path, code) || path.filename() == "layer.json";
}

int run_info(const InfoArguments& arguments) {
  if (arguments.mesh_path.empty()) {
    const ReportStyle style = arguments.wants_json ? ReportStyle::kJson : ReportStyle::kText;
    return is_tile_set(arguments.path) ? report_tile_set(arguments.path, style)
                                       : report_tile(arguments.path, style);
  }
  if (is_tile_set(arguments.path)) {
    throw UsageError(
        fmt::format("--mesh writes a single tile; {} is a tile set: name one of its .terrain files",
                    arguments.path));
  }
  MeshRequest request = {.tile_path = arguments.path,
                         .mesh_path = arguments.mesh_path,
                         .frame = arguments.frame == "ecef" ? Frame::kEcef : Frame::kEnu,
                         .key = std::nullopt,
                         .projection = std::nullopt};
  if (!arguments.key.empty()) request.key = parse_key(arguments.key);
  if (!arguments.projection.empty()) {
    request.projection =
        arguments.projection == "mercator" ? Projection::kMercator : Projection::kGeodetic;
  }
  return write_tile_mesh(request);
}

}  // namespace

void register_info(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<InfoArguments>();
  CLI::App* command =
      app.add_subcommand("info", "Show what a tile set or a tile holds; write a tile as a mesh");
  command->add_option("path", arguments->path, "Folder of a tile set, its layer.json, or a tile")
      ->required()
      ->type_name("OUT|TILE");
  CLI::Option* json =
      command->add_flag("--json", arguments->wants_json, "Print JSON instead of text");
  CLI::Option* mesh =
      command
          ->add_option("--mesh", arguments->mesh_path,
                       "Write the tile as a mesh instead; the name ends in .ply (binary, double), "
                       ".obj (text), .glb (float32, y up) or .stl (float32)")
          ->type_name("FILE")
          ->excludes(json);
  command
      ->add_option(
          "--frame", arguments->frame,
          "Axes of the mesh, in metres around the middle of the tile on the ellipsoid: enu "
          "(east, north, up) or ecef (earth-centred axes). DEFAULT: enu")
      ->needs(mesh)
      ->check(CLI::IsMember({"enu", "ecef"}));
  command
      ->add_option("--key", arguments->key,
                   "Which tile it is. DEFAULT: the end of its path, .../zoom/x/y.terrain")
      ->needs(mesh)
      ->type_name("ZOOM/X/Y");
  command
      ->add_option("--projection", arguments->projection,
                   "Tiling scheme: geodetic or mercator. DEFAULT: as the set's layer.json says, "
                   "else geodetic")
      ->needs(mesh)
      ->check(CLI::IsMember({"geodetic", "mercator"}));
  command->footer(kFooter);
  command->callback(
      [arguments, &action] { action = [arguments] { return run_info(*arguments); }; });
}

}  // namespace qmpipe
