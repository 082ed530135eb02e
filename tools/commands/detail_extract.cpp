#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "formats/bytes/errors.h"
#include "formats/bytes/printable.h"
#include "formats/tile/mesh_export.h"
#include "pipeline/detail_model/extract.h"
#include "tools/arguments/help_format.h"
#include "tools/arguments/number_options.h"
#include "tools/arguments/parse_values.h"
#include "tools/commands/detail_commands.h"

namespace qmpipe {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kDetailExtractFooter =
    "One of --svo, --triangles, --level, --distance and --eye says how fine the mesh is:\n"
    "  --svo D          of each block the coarsest level whose smallest visible object is no "
    "larger\n"
    "  --triangles N    the finest mesh of one threshold with no more triangles\n"
    "  --level L        L vertices above the coarsest level of each block\n"
    "  --distance R     the threshold that is --pixels long on the screen at R metres:\n"
    "                   pixels * 2 R tan(fov / 2) / screen\n"
    "  --eye X,Y,Z      the same, each block by its own distance from the eye\n"
    "Whatever the levels, the blocks' rims are the same, so there are no cracks.\n"
    "\n"
    "Examples:\n"
    "  qmpipe detail extract terrain.h5 --svo 2 -o terrain.ply\n"
    "  qmpipe detail extract terrain.h5 --distance 5000 --fov 45 --screen 1080 -o far.glb\n"
    "Exit codes: 0 written, 1 failed, 2 wrong usage.";

struct ExtractArguments {
  std::string path;
  std::string output;
  std::string frame = "local";
  std::optional<double> svo_m;
  std::optional<std::int64_t> triangles;
  std::optional<std::int64_t> level;
  std::optional<double> distance_m;
  std::vector<double> eye_m;
  DetailView view;
  bool wants_json = false;
};

DetailLevels chosen_levels(const ExtractArguments& arguments, const DetailModel& model) {
  if (arguments.svo_m) return levels_for_svo(model, *arguments.svo_m);
  if (arguments.triangles) return levels_for_triangles(model, *arguments.triangles);
  if (arguments.level) return levels_at(model, static_cast<std::size_t>(*arguments.level));
  if (arguments.distance_m) {
    return levels_for_svo(model, svo_at_distance_m(*arguments.distance_m, arguments.view));
  }
  const std::vector<double>& eye = arguments.eye_m;
  return levels_from_eye(model, {eye[0], eye[1], eye[2]}, arguments.view);
}

void require_one_choice(const ExtractArguments& arguments) {
  const int given = (arguments.svo_m ? 1 : 0) + (arguments.triangles ? 1 : 0) +
                    (arguments.level ? 1 : 0) + (arguments.distance_m ? 1 : 0) +
                    (arguments.eye_m.empty() ? 0 : 1);
  if (given == 1) return;
  throw UsageError("give one of --svo, --triangles, --level, --distance and --eye");
}

// From the middle of the box, at height 0.
void make_local(ExportMesh& mesh) {
  std::array<double, 2> low = {mesh.positions_m.front()[0], mesh.positions_m.front()[1]};
  std::array<double, 2> high = low;
  for (const Vec3& p : mesh.positions_m) {
    for (std::size_t k = 0; k < 2; ++k) {
      low[k] = std::min(low[k], p[k]);
      high[k] = std::max(high[k], p[k]);
    }
  }
  for (Vec3& p : mesh.positions_m) {
    for (std::size_t k = 0; k < 2; ++k) p[k] -= (low[k] + high[k]) / 2;
  }
}

void print_text(const DetailModel& model, const DetailLevels& levels, const ExportMesh& mesh,
                const ExtractArguments& arguments) {
  fmt::print("{}: {} triangles, {} vertices\n", printable_line(arguments.output),
             mesh.indices.size() / 3, mesh.positions_m.size());
  fmt::print("{:>6} {:>12} {:>12} {:>12} {:>14}\n", "block", "level", "of", "svo m", "triangles");
  for (std::size_t b = 0; b < levels.size(); ++b) {
    const DetailBlock& block = model.blocks[b];
    fmt::print("{:>6} {:>12} {:>12} {:>12.4g} {:>14}\n", b, levels[b], block.levels(),
               block.svo_m[levels[b]], block.triangles_at(levels[b]));
  }
}

void print_json(const DetailModel& model, const DetailLevels& levels, const ExportMesh& mesh,
                const ExtractArguments& arguments) {
  Json blocks = Json::array();
  for (std::size_t b = 0; b < levels.size(); ++b) {
    const DetailBlock& block = model.blocks[b];
    blocks.push_back({{"level", levels[b]},
                      {"levels", block.levels()},
                      {"svo_m", block.svo_m[levels[b]]},
                      {"triangles", block.triangles_at(levels[b])},
                      {"simplifications", block.levels() - levels[b]}});
    if (!arguments.eye_m.empty()) {
      const std::vector<double>& eye = arguments.eye_m;
      blocks.back()["distance_m"] = distance_to_block_m(model, b, {eye[0], eye[1], eye[2]});
    }
  }
  const Json document = {{"mesh", arguments.output},
                         {"triangles", mesh.indices.size() / 3},
                         {"vertices", mesh.positions_m.size()},
                         {"blocks", std::move(blocks)}};
  fmt::print("{}\n", document.dump(2));
}

int run_extract(const ExtractArguments& arguments) {
  require_one_choice(arguments);
  const bool is_local = is_local_frame(arguments.frame, mesh_format_of(arguments.output));
  const DetailModel model = load_model(arguments.path);
  const DetailLevels levels = chosen_levels(arguments, model);
  auto mesh = extract_mesh(model, levels);
  if (!mesh) {
    throw IoError("cannot extract from", arguments.path, mesh.error().message,
                  "Build the model again with qmpipe detail build.");
  }
  if (is_local) make_local(*mesh);
  write_mesh_file(arguments.output, *mesh);
  if (arguments.wants_json) {
    print_json(model, levels, *mesh, arguments);
  } else {
    print_text(model, levels, *mesh, arguments);
  }
  return 0;
}

void add_choices(CLI::App& command, ExtractArguments& arguments) {
  begin_group(command, kQualityGroup);
  command.add_option("--svo", arguments.svo_m, "Smallest visible object, metres")
      ->check(fault_of_negative)
      ->type_name("D");
  command.add_option("--triangles", arguments.triangles, "Triangles at most")
      ->check(fault_of_not_positive)
      ->type_name("N");
  command.add_option("--level", arguments.level, "Level; 0 is the coarsest")
      ->check(fault_of_negative)
      ->type_name("L");
  command.add_option("--distance", arguments.distance_m, "Distance of the eye, metres")
      ->check(fault_of_negative)
      ->type_name("R");
  command.add_option("--eye", arguments.eye_m, "Where the eye is, metres, as --frame crs has them")
      ->delimiter(',')
      ->expected(3)
      ->type_name("X,Y,Z");
  add_view_options(command, arguments.view);
}

}  // namespace

void add_view_options(CLI::App& command, DetailView& view) {
  begin_group(command, kPapersGroup);
  command.add_option("--fov", view.fov_deg, "Vertical field of view, degrees")
      ->check(CLI::Range(0.1, 179.0))
      ->capture_default_str()
      ->type_name("F");
  command.add_option("--screen", view.screen_height, "Height of the screen, pixels")
      ->check(fault_of_not_positive)
      ->capture_default_str()
      ->type_name("H");
  command.add_option("--pixels", view.pixels, "Length of the smallest visible object, pixels")
      ->check(fault_of_not_positive)
      ->capture_default_str()
      ->type_name("P");
}

void register_detail_extract(CLI::App& detail, std::function<int()>& action) {
  const auto arguments = std::make_shared<ExtractArguments>();
  CLI::App* command = detail.add_subcommand("extract", "Write the mesh of a scale");
  command->footer(kDetailExtractFooter);
  command->add_option("FILE", arguments->path, "The model")->required();
  command
      ->add_option("-o,--output", arguments->output,
                   "Mesh to write; the name ends in .ply, .obj, .glb or .stl")
      ->required()
      ->type_name("MESH");
  add_choices(*command, *arguments);
  begin_group(*command, kOutputGroup);
  command
      ->add_option("--frame", arguments->frame,
                   "local: metres from the mesh's middle; crs: the input's own x and y, in metres")
      ->check(CLI::IsMember({"local", "crs"}))
      ->capture_default_str();
  begin_group(*command, kMessagesGroup);
  command->add_flag("--json", arguments->wants_json, "Say what was chosen as JSON");
  command->callback(
      [arguments, &action] { action = [arguments] { return run_extract(*arguments); }; });
}

}  // namespace qmpipe
