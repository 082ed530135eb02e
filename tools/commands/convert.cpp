#include "tools/commands/convert.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>

#include <fmt/format.h>

#include "formats/bytes/errors.h"
#include "formats/bytes/printable.h"
#include "formats/mbtiles/mbtiles.h"
#include "formats/tile_sets/open_tile_set.h"
#include "pipeline/common/machine_share.h"
#include "pipeline/convert/convert.h"
#include "pipeline/run/progress.h"
#include "tools/arguments/help_format.h"
#include "tools/arguments/interrupt.h"
#include "tools/arguments/parse_values.h"
#include "tools/arguments/terminal.h"

namespace qmpipe {
namespace {

namespace fs = std::filesystem;

constexpr const char* kConvertFooter =
    "A set has one of three forms, told by the output's name: OUT.mbtiles (SQLite, for tile\n"
    "servers), OUT.pmtiles (for any store that answers range requests), else a folder. Sets of\n"
    "other programs too. The bytes of every tile stay as they are, unless --gzip says otherwise;\n"
    "an archive .pmtiles has one compression, so that plain tiles among gzipped ones are gzipped\n"
    "there. layer.json stays byte for byte unless a client would stumble over it; what is changed\n"
    "in it is told on stderr. A PMTiles archive holds the geodetic tile z/x/y at zoom z + 1.\n"
    "\n"
    "pack and unpack are convert with the form demanded: a file, a folder.\n"
    "\n"
    "Exit code 0: done; 1: a tile cannot be read, or the output not be written; 2: usage;\n"
    "130: interrupted, and no unfinished file is left.\n"
    "\n"
    "Examples:\n"
    "  qmpipe pack out -o terrain.mbtiles\n"
    "  qmpipe convert terrain.mbtiles -o terrain.pmtiles\n"
    "  qmpipe unpack terrain.pmtiles -o out --gzip none";

enum class Demand { kAnyForm, kFile, kFolder };

struct ConvertArguments {
  Demand demand = Demand::kAnyForm;
  std::string input;
  std::string output;
  std::string gzip = "keep";
  std::string rows;
  bool overwrite = false;
  bool wants_json = false;
  std::int32_t threads = 1;
};

const char* name_of(TileForm form) {
  switch (form) {
    case TileForm::kFolder:
      return "folder";
    case TileForm::kMbtiles:
      return "mbtiles";
    case TileForm::kPmtiles:
      return "pmtiles";
  }
  return "?";
}

// Two names of one thing. A set's folder may be named by its layer.json.
bool is_same_place(const fs::path& input, const fs::path& output) {
  std::error_code code;
  if (fs::equivalent(input, output, code)) return true;
  const fs::path folder = input.has_parent_path() ? input.parent_path() : ".";
  return input.filename() == "layer.json" && fs::equivalent(folder, output, code);
}

void require_sound(const ConvertArguments& arguments) {
  const TileForm form = form_of(arguments.output);
  if (arguments.demand == Demand::kFile && form == TileForm::kFolder) {
    throw UsageError("-o " + arguments.output +
                     ": pack makes a file; give a name that ends in .mbtiles or .pmtiles");
  }
  if (arguments.demand == Demand::kFolder && form != TileForm::kFolder) {
    throw UsageError("-o " + arguments.output +
                     ": unpack makes a folder; use convert or pack for a file");
  }
  if (is_same_place(arguments.input, arguments.output)) {
    throw UsageError("-o " + arguments.output + ": the output is the input; choose another name");
  }
}

ConvertOptions options_of(const ConvertArguments& arguments) {
  ConvertOptions options;
  options.output = arguments.output;
  // "out/" is the folder "out".
  if (!options.output.has_filename()) options.output = options.output.parent_path();
  options.overwrite = arguments.overwrite ? Overwrite::kYes : Overwrite::kNo;
  options.threads = arguments.threads;
  if (arguments.gzip == "keep") return options;
  const std::optional<int> level = parse_gzip(arguments.gzip);
  options.packing = level ? Packing::kGzip : Packing::kPlain;
  options.gzip_level = level.value_or(options.gzip_level);
  return options;
}

std::unique_ptr<TileSet> open_input(const ConvertArguments& arguments) {
  if (arguments.rows.empty()) return open_tile_set(arguments.input);
  if (form_of(arguments.input) != TileForm::kMbtiles) {
    throw UsageError("--rows " + arguments.rows + ": only an .mbtiles input has rows to count");
  }
  return open_mbtiles_set(arguments.input,
                          arguments.rows == "xyz" ? RowOrder::kXyz : RowOrder::kTms);
}

std::string json_of(const ConvertReport& report, const ConvertOptions& options) {
  const nlohmann::ordered_json json = {{"output", options.output.string()},
                                       {"form", name_of(form_of(options.output))},
                                       {"tiles", report.tiles},
                                       {"read_bytes", report.read_bytes},
                                       {"written_bytes", report.written_bytes},
                                       {"repacked_tiles", report.repacked_tiles},
                                       {"strays", report.strays},
                                       {"notes", report.notes}};
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

int run_convert(const ConvertArguments& arguments) {
  require_sound(arguments);
  const ConvertOptions options = options_of(arguments);
  Progress progress(progress_style(false), stop_flag_of_signals());
  const std::unique_ptr<TileSet> input = open_input(arguments);
  const ConvertReport report = convert(*input, options, progress);
  const std::string text =
      arguments.wants_json
          ? json_of(report, options)
          : fmt::format("converted: {} tiles, {} bytes read, {} written, into {}\n", report.tiles,
                        report.read_bytes, report.written_bytes,
                        printable_line(options.output.string()));
  std::fwrite(text.data(), 1, text.size(), stdout);
  return 0;
}

void register_one(CLI::App& app, std::function<int()>& action, const char* name,
                  const char* description, Demand demand) {
  const auto arguments = std::make_shared<ConvertArguments>();
  arguments->demand = demand;
  arguments->threads = usable_threads();
  CLI::App* command = app.add_subcommand(name, description);
  command->footer(kConvertFooter);
  begin_group(*command, kOutputGroup);
  command
      ->add_option(
          "IN", arguments->input,
          "The tile set: its folder, the layer.json in it, or an .mbtiles or .pmtiles file")
      ->required();
  command
      ->add_option("-o,--output", arguments->output,
                   "Where to; a name that ends in .mbtiles or .pmtiles makes such a file")
      ->type_name("OUT")
      ->required();
  command
      ->add_option("--gzip", arguments->gzip,
                   "Compression of the tiles: keep, none, or a level from 1 (fast) to 12 (small)")
      ->type_name("HOW")
      ->capture_default_str();
  begin_group(*command, kInputGroup);
  command
      ->add_option("--rows", arguments->rows,
                   "How an .mbtiles input counts its rows: tms (from the south, as the "
                   "specification says; default) or xyz (from the north, as kalisio/k2 does)")
      ->check(CLI::IsMember({"tms", "xyz"}));
  begin_group(*command, kOutputGroup);
  command->add_flag("--overwrite", arguments->overwrite,
                    "Replace an existing file, or the tile set in a folder");
  begin_group(*command, kResourcesGroup);
  command
      ->add_option("--threads", arguments->threads, "Threads; the output does not depend on them")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  begin_group(*command, kMessagesGroup);
  command->add_flag("--json", arguments->wants_json, "Write one JSON object instead of a line");
  command->callback(
      [arguments, &action] { action = [arguments] { return run_convert(*arguments); }; });
}

}  // namespace

void register_convert(CLI::App& app, std::function<int()>& action) {
  register_one(app, action, "convert",
               "Turn a tile set into another form: folder, MBTiles or PMTiles", Demand::kAnyForm);
  register_one(app, action, "pack", "Put a tile set into one file, .mbtiles or .pmtiles",
               Demand::kFile);
  register_one(app, action, "unpack", "Turn a packed tile set into a folder", Demand::kFolder);
}

}  // namespace qmpipe
