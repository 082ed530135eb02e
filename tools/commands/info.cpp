#include "tools/commands/info.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "formats/bytes/errors.h"
#include "formats/tile/tile_path.h"
#include "formats/tile_sets/open_tile_set.h"
#include "tools/arguments/help_format.h"
#include "tools/commands/info_report.h"

namespace qmpipe {
namespace {

constexpr const char* kInfoFooter =
    "Sizes are in bytes, heights in metres above the WGS84 ellipsoid, positions in metres.\n"
    "Exit code 1: layer.json is missing or damaged, or the tile is missing or damaged.\n"
    "\n"
    "Examples:\n"
    "  qmpipe info out\n"
    "  qmpipe info out/10/1073/712.terrain --json\n"
    "  qmpipe info out/10/1073/712.terrain --mesh tile.glb\n"
    "  qmpipe info out.mbtiles --key 10/1073/712";

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

int run_info(const InfoArguments& arguments) {
  const ReportStyle style = arguments.wants_json ? ReportStyle::kJson : ReportStyle::kText;
  const bool in_set = is_tile_set(arguments.path);
  const std::optional<TileKey> key =
      arguments.key.empty() ? std::nullopt : std::optional(parse_key(arguments.key));
  const bool wants_mesh = !arguments.mesh_path.empty();
  if (in_set && !key) {
    if (!wants_mesh) return report_tile_set(arguments.path, style);
    throw UsageError(
        fmt::format("--mesh writes a single tile; {} is a tile set: name the tile with --key "
                    "zoom/x/y, or one of its .terrain files",
                    arguments.path));
  }
  if (key && !in_set && !wants_mesh) {
    throw UsageError("--key: names a tile of a set, or says where a tile lies for --mesh");
  }
  const TilePlace place = {.path = arguments.path, .key_in_set = in_set ? key : std::nullopt};
  if (!wants_mesh) return report_tile(place, style);
  MeshRequest request = {.place = place,
                         .mesh_path = arguments.mesh_path,
                         .frame = arguments.frame == "ecef" ? Frame::kEcef : Frame::kEnu,
                         .key = in_set ? std::nullopt : key,
                         .projection = std::nullopt};
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
  command
      ->add_option("path", arguments->path,
                   "Folder of a tile set, its layer.json, an .mbtiles file, or a tile")
      ->required()
      ->type_name("OUT|TILE");
  begin_group(*command, kMessagesGroup);
  CLI::Option* json =
      command->add_flag("--json", arguments->wants_json, "Print JSON instead of text");
  begin_group(*command, kOutputGroup);
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
  begin_group(*command, kInputGroup);
  command
      ->add_option(
          "--key", arguments->key,
          "The tile of a set to show or to write. With --mesh of a tile's file: which tile it "
          "is. DEFAULT: the end of its path, .../zoom/x/y.terrain")
      ->type_name("ZOOM/X/Y");
  command
      ->add_option("--projection", arguments->projection,
                   "Tiling scheme: geodetic or mercator. DEFAULT: as the set's layer.json says, "
                   "else geodetic")
      ->needs(mesh)
      ->check(CLI::IsMember({"geodetic", "mercator"}));
  command->footer(kInfoFooter);
  command->callback(
      [arguments, &action] { action = [arguments] { return run_info(*arguments); }; });
}

}  // namespace qmpipe
