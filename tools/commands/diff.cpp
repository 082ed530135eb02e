#include "tools/commands/diff.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <string>

#include "formats/tile_sets/open_tile_set.h"
#include "pipeline/common/machine_share.h"
#include "pipeline/convert/diff_sets.h"
#include "pipeline/run/progress.h"
#include "tools/arguments/help_format.h"
#include "tools/arguments/interrupt.h"
#include "tools/arguments/number_options.h"
#include "tools/arguments/terminal.h"

namespace qmpipe {
namespace {

constexpr int kExitDifferent = 3;

constexpr const char* kDiffFooter =
    "Compares layer.json key by key, then tile by tile: those of one set only; those with the "
    "same\n"
    "bytes; those that are the same once unpacked; and those that differ, in what: header, number\n"
    "of vertices and triangles, heights in metres at the posts that both have, triangles, side\n"
    "lists, normals, other extensions. Each set is a folder, its layer.json, or an .mbtiles or\n"
    ".pmtiles file. The worst tiles come first: what cannot be decoded, then by the distance of\n"
    "heights, then by the posts that one alone has.\n"
    "\n"
    "Exit code 0: the same, but for compression maybe; 1: a set cannot be opened; 2: usage;\n"
    "3: different; 130: interrupted.\n"
    "\n"
    "Examples:\n"
    "  qmpipe diff out packed.mbtiles\n"
    "  qmpipe diff before after --json > diff.json";

struct DiffArguments {
  std::string a;
  std::string b;
  DiffOptions options;
  bool wants_json = false;
};

int run_diff(const DiffArguments& arguments) {
  Progress progress(progress_style(false), stop_flag_of_signals());
  const std::unique_ptr<TileSet> a = open_tile_set(arguments.a);
  const std::unique_ptr<TileSet> b = open_tile_set(arguments.b);
  const DiffReport report = diff_sets(*a, *b, arguments.options, progress);
  const std::string text = arguments.wants_json ? json_of(report) : text_of(report);
  std::fwrite(text.data(), 1, text.size(), stdout);
  return report.is_same() ? 0 : kExitDifferent;
}

}  // namespace

void register_diff(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<DiffArguments>();
  DiffOptions& options = arguments->options;
  options.threads = usable_threads();
  CLI::App* command = app.add_subcommand(
      "diff", "Compare two tile sets: layer.json, which tiles there are, and what differs in them");
  command->footer(kDiffFooter);
  command->add_option("A", arguments->a, "A tile set")->required();
  command->add_option("B", arguments->b, "Another one")->required();
  begin_group(*command, kResourcesGroup);
  command->add_option("--threads", options.threads, "Threads; the report does not depend on them")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  begin_group(*command, kMessagesGroup);
  command
      ->add_option("--max", options.most_listed,
                   "Tiles of each kind to show (different, only in A, only in B); all are counted")
      ->type_name("N")
      ->check(fault_of_negative)
      ->capture_default_str();
  command->add_flag("--json", arguments->wants_json, "Write one JSON object instead of a table");
  command->callback(
      [arguments, &action] { action = [arguments] { return run_diff(*arguments); }; });
}

}  // namespace qmpipe
