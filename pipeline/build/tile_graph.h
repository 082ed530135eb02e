// The mesh pass as a TBB flow graph:
//
//   ready queue -> window -> mesh -> finish -> encode -> (sequencer) -> sink
//        ^                     |                                          |
//        |<-- borders published                                          |
//        |<-- room given back -------------------------------------------+
//
// Every tile in the graph holds a place in the ready queue's window, so all buffers together never
// hold more than `max_in_flight` tiles. The sequencer hands tiles to the sink in the schedule's
// order, whatever order they finish in. An exception in a node cancels the graph and comes out of
// run(); a request to stop lets the tiles in flight finish first.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "formats/run_store/border_store.h"
#include "formats/tile/tile_sink.h"
#include "pipeline/build/build_plan.h"
#include "pipeline/build/tile_builder.h"
#include "pipeline/run/progress.h"

namespace qmpipe {

struct TileGraphOptions {
  std::int32_t threads = 1;
  std::int32_t max_in_flight = 8;
  std::optional<int> gzip_level;
  // The tiles before it are done; `borders` has what they decided.
  TileIndex first_tile = 0;
};

struct TileGraphResult {
  std::int64_t tiles_done = 0;  // those before the first one included
  std::int32_t largest_in_flight = 0;
  bool stopped = false;  // before all tiles were done, on request
};

// `on_tile` is called for each tile in the schedule's order, after the sink has it, by one thread at
// a time. Throws what a node or the sink throws.
TileGraphResult run_tile_graph(const BuildPlan& plan, const Heightfield& heightfield,
                               BorderStore& borders, TileSink& sink,
                               const TileGraphOptions& options, Progress& progress,
                               const std::function<void(const TileWork&)>& on_tile);

}  // namespace qmpipe
