// Writes checkpoints while tiles go on: what is in the sink is synced, the borders that later tiles
// need are sealed, and only then does the run's record count the tiles
// (docs/decisions/0004-checkpoints-count-a-prefix.md).
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <future>

#include "formats/run_store/border_store.h"
#include "formats/tile/tile_sink.h"
#include "pipeline/build/report.h"
#include "pipeline/run/run_record.h"

namespace qmpipe {

// Used by one thread at a time; the work of a checkpoint is done on a thread of its own.
class Checkpointer {
 public:
  // `interval_s`: the time between two checkpoints at least. REQUIRES: all outlive this.
  Checkpointer(TileSink& sink, BorderStore& borders, RunRecord& record, double interval_s);
  // Waits for a checkpoint under way; whether it worked is then nobody's concern.
  ~Checkpointer();
  Checkpointer(const Checkpointer&) = delete;
  Checkpointer& operator=(const Checkpointer&) = delete;

  // To be called after each tile with the sums of all tiles so far: starts a checkpoint when it is
  // time and none is under way. Throws what the last one threw.
  void after_tile(const BuildReport& report);
  // A checkpoint now; on return it is written. Throws IoError.
  void write_now(const BuildReport& report);

 private:
  void start(const BuildReport& report);

  TileSink& sink_;
  BorderStore& borders_;
  RunRecord& record_;
  const std::chrono::duration<double> interval_;
  std::chrono::steady_clock::time_point last_start_;
  std::future<void> under_way_;
};

}  // namespace qmpipe
