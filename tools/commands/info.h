// `qmpipe info`: what a tile set or a tile holds; a tile as a mesh that other programs open.
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace qmpipe {

// Adds the subcommand to `app`. When the arguments ask for it, `action` is set to what main() runs;
// its result is the exit code: 0, or 1 when layer.json or the tile cannot be read as such. It throws
// UsageError and IoError. REQUIRES: `action` outlives the parsing.
void register_info(CLI::App& app, std::function<int()>& action);

}  // namespace qmpipe
