// The subcommands of `qmpipe detail`, one file each.
#pragma once

#include <functional>
#include <string>

#include "formats/detail_model/data.h"
#include "pipeline/detail_model/extract.h"

namespace CLI {
class App;
}

namespace qmpipe {

void register_detail_build(CLI::App& detail, std::function<int()>& action);
void register_detail_extract(CLI::App& detail, std::function<int()>& action);
void register_detail_info(CLI::App& detail, std::function<int()>& action);
void register_detail_verify(CLI::App& detail, std::function<int()>& action);

// --fov, --screen, --pixels. REQUIRES: `view` outlives the parsing.
void add_view_options(CLI::App& command, DetailView& view);

// The model in a file. Throws IoError when it cannot be read.
DetailModel load_model(const std::string& path);

}  // namespace qmpipe
