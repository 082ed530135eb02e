#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"
#include "formats/bytes/printable.h"
#include "pipeline/common/machine_share.h"
#include "pipeline/detail_model/chart.h"
#include "pipeline/detail_model/extract.h"
#include "pipeline/detail_model/increments.h"
#include "pipeline/detail_model/verify.h"
#include "tools/arguments/exit_codes.h"
#include "tools/arguments/help_format.h"
#include "tools/arguments/interrupt.h"
#include "tools/arguments/terminal.h"
#include "tools/commands/detail_commands.h"

namespace qmpipe {
namespace {

using Json = nlohmann::ordered_json;

struct DetailVerifyArguments {
  std::string path;
  std::int32_t threads = 1;
  bool wants_json = false;
};

int run_verify(const DetailVerifyArguments& arguments) {
  const DetailModel model = load_model(arguments.path);
  Progress progress(progress_style(false), stop_flag_of_signals());
  const DetailVerifyReport report = verify_detail(model, arguments.threads, progress);
  if (arguments.wants_json) {
    const Json document = {{"levels_walked", report.levels_walked},
                           {"triangles_checked", report.triangles_checked},
                           {"faults", report.faults}};
    fmt::print("{}\n", document.dump(2));
  } else {
    fmt::print("{} levels walked up and down, {} triangles checked\n", report.levels_walked,
               report.triangles_checked);
    for (const std::string& fault : report.faults) fmt::print("fault: {}\n", fault);
    if (report.faults.empty()) fmt::print("no faults\n");
  }
  return report.faults.empty() ? 0 : kExitFaults;
}

struct DetailInfoArguments {
  std::string path;
  std::string chart;
  DetailView view;
  bool increments = false;
  bool wants_json = false;
};

Json block_json(const DetailBlock& block) {
  return {{"points", block.points.size()},
          {"levels", block.levels()},
          {"coarsest_triangles", block.triangles_at(0)},
          {"finest_triangles", block.triangles_at(block.levels())},
          {"coarsest_svo_m", block.svo_m.front()},
          {"finest_svo_m", block.svo_m.back()}};
}

void print_info(const DetailInfoArguments& arguments, const DetailModel& model) {
  std::error_code code;
  fmt::print("{}: {} bytes, {} blocks, {} triangles in seams, interval {}\n",
             printable_line(arguments.path), std::filesystem::file_size(arguments.path, code),
             model.blocks.size(), model.seams.size(), model.interval);
  const DetailFrame& frame = model.frame;
  fmt::print("steps {:g} x {:g} x {:g} m from {:.3f} {:.3f} {:.3f}\n", frame.step_m[0],
             frame.step_m[1], frame.step_m[2], frame.offset[0], frame.offset[1], frame.offset[2]);
  fmt::print("{:>6} {:>10} {:>10} {:>12} {:>12} {:>12} {:>12}\n", "block", "points", "levels",
             "coarsest T", "finest T", "coarsest svo", "finest svo");
  for (std::size_t b = 0; b < model.blocks.size(); ++b) {
    const DetailBlock& block = model.blocks[b];
    fmt::print("{:>6} {:>10} {:>10} {:>12} {:>12} {:>12.4g} {:>12.4g}\n", b, block.points.size(),
               block.levels(), block.triangles_at(0), block.triangles_at(block.levels()),
               block.svo_m.front(), block.svo_m.back());
  }
}

IncrementSums increments_of(const DetailModel& model, const std::string& path) {
  const auto sums = sum_increments(model);
  if (sums) return *sums;
  throw IoError("cannot walk through", path, sums.error().message,
                "Build the model again with qmpipe detail build.");
}

void print_increments(const IncrementSums& sums, std::uint32_t interval) {
  const auto ratio = [](std::int64_t a, std::int64_t b) {
    return static_cast<double>(a) / static_cast<double>(std::max<std::int64_t>(1, b));
  };
  fmt::print(
      "increments of one level:  {}, {:.2f} changed triangles a level, {:.1f} bytes as arrays\n"
      "merged over {} levels: {}, {:.2f} changed triangles a level, {:.1f} bytes as arrays\n",
      sums.levels, ratio(sums.changed_singly, sums.levels),
      ratio(sums.raw_bytes_singly, sums.levels), interval, sums.increments,
      ratio(sums.changed_merged, sums.levels), ratio(sums.raw_bytes_merged, sums.levels));
}

Json increments_json(const IncrementSums& sums) {
  return {{"levels", sums.levels},
          {"increments", sums.increments},
          {"changed_singly", sums.changed_singly},
          {"changed_merged", sums.changed_merged},
          {"raw_bytes_singly", sums.raw_bytes_singly},
          {"raw_bytes_merged", sums.raw_bytes_merged}};
}

int run_info(const DetailInfoArguments& arguments) {
  const DetailModel model = load_model(arguments.path);
  if (!arguments.chart.empty()) {
    const std::string page = detail_chart_page(model, arguments.view, arguments.path);
    write_file_atomically(arguments.chart,
                          {reinterpret_cast<const std::uint8_t*>(page.data()), page.size()});
  }
  if (!arguments.wants_json) {
    print_info(arguments, model);
    if (arguments.increments)
      print_increments(increments_of(model, arguments.path), model.interval);
    return 0;
  }
  Json blocks = Json::array();
  for (const DetailBlock& block : model.blocks) blocks.push_back(block_json(block));
  Json document = {{"interval", model.interval},
                   {"crs", model.crs_wkt},
                   {"offset", model.frame.offset},
                   {"step_m", model.frame.step_m},
                   {"seam_triangles", model.seams.size()},
                   {"coarsest_triangles", triangles_of(model, levels_at(model, 0))},
                   {"finest_triangles", triangles_of(model, levels_for_svo(model, 0))},
                   {"blocks", std::move(blocks)}};
  if (arguments.increments) {
    document["increments"] = increments_json(increments_of(model, arguments.path));
  }
  fmt::print("{}\n", document.dump(2, ' ', false, Json::error_handler_t::replace));
  return 0;
}

}  // namespace

void register_detail_verify(CLI::App& detail, std::function<int()>& action) {
  const auto arguments = std::make_shared<DetailVerifyArguments>();
  arguments->threads = usable_threads();
  CLI::App* command =
      detail.add_subcommand("verify", "Check a model by walking through its levels");
  command->footer(
      "Walks each block from its coarsest level to its finest and back: every triangle of every "
      "level\n"
      "is counter-clockwise, the way back leads to the same meshes, the rims of blocks are the "
      "same\n"
      "on all levels, thresholds never rise towards finer levels. At the coarsest and the finest "
      "level\n"
      "also: no edge with three triangles, no overlap, seams among them.\n"
      "\n"
      "Example:\n"
      "  qmpipe detail verify terrain.h5\n"
      "Exit codes: 0 no fault, 1 the file cannot be read, 2 wrong usage, 3 faults, 130 "
      "interrupted.");
  command->add_option("FILE", arguments->path, "The model")->required();
  begin_group(*command, kResourcesGroup);
  command->add_option("--threads", arguments->threads, "Threads, each with a block of its own")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  begin_group(*command, kMessagesGroup);
  command->add_flag("--json", arguments->wants_json, "Report as JSON");
  command->callback(
      [arguments, &action] { action = [arguments] { return run_verify(*arguments); }; });
}

void register_detail_info(CLI::App& detail, std::function<int()>& action) {
  const auto arguments = std::make_shared<DetailInfoArguments>();
  CLI::App* command = detail.add_subcommand("info", "Show what a model holds");
  command->footer(
      "svo: the smallest visible object of a level, metres.\n"
      "\n"
      "Example:\n"
      "  qmpipe detail info terrain.h5 --json\n"
      "  qmpipe detail info terrain.h5 --chart terrain.html");
  command->add_option("FILE", arguments->path, "The model")->required();
  begin_group(*command, kOutputGroup);
  command
      ->add_option(
          "--chart", arguments->chart,
          "Page to write with charts of triangles, simplifications and distance against the "
          "threshold")
      ->type_name("HTML");
  add_view_options(*command, arguments->view);
  begin_group(*command, kMessagesGroup);
  command->add_flag(
      "--increments", arguments->increments,
      "Walk through the model and tell how many triangles change a level, one by one and "
      "merged over its interval");
  command->add_flag("--json", arguments->wants_json, "Write JSON");
  command->callback(
      [arguments, &action] { action = [arguments] { return run_info(*arguments); }; });
}

}  // namespace qmpipe
