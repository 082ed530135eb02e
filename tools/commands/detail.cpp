#include "tools/commands/detail.h"

#include <CLI/CLI.hpp>

#include "formats/bytes/errors.h"
#include "formats/detail_model/file.h"
#include "tools/commands/detail_commands.h"

namespace qmpipe {

DetailModel load_model(const std::string& path) {
  auto model = read_detail_file(path);
  if (!model) {
    throw IoError("cannot read the model", path, model.error().message,
                  "Build it again with qmpipe detail build.");
  }
  return std::move(*model);
}

void register_detail(CLI::App& app, std::function<int()>& action) {
  CLI::App* detail = app.add_subcommand(
      "detail",
      "One terrain at every scale: build, extract, info, verify of detail-increment models");
  detail->require_subcommand(1);
  detail->footer(
      "A detail-increment model (Ai et al. 2019) holds the coarsest mesh of a terrain and the "
      "steps\n"
      "that make it finer, two triangles at a time, block by block.\n"
      "\n"
      "Examples:\n"
      "  qmpipe detail build dem.tif -o terrain.h5\n"
      "  qmpipe detail extract terrain.h5 --svo 2 -o terrain.ply\n"
      "  qmpipe detail build --help");
  register_detail_build(*detail, action);
  register_detail_extract(*detail, action);
  register_detail_info(*detail, action);
  register_detail_verify(*detail, action);
}

}  // namespace qmpipe
