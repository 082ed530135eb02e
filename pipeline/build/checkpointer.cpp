#include "pipeline/build/checkpointer.h"

#include "formats/run_store/hdf5_border_store.h"
#include "pipeline/build/report_state.h"

namespace qmpipe {

Checkpointer::Checkpointer(TileSink& sink, BorderStore& borders, RunRecord& record,
                           double interval_s)
    : sink_(sink),
      borders_(borders),
      record_(record),
      interval_(interval_s),
      last_start_(std::chrono::steady_clock::now()) {}

Checkpointer::~Checkpointer() {
  if (under_way_.valid()) under_way_.wait();
}

void Checkpointer::after_tile(const BuildReport& report) {
  if (std::chrono::steady_clock::now() - last_start_ < interval_) return;
  if (under_way_.valid()) {
    if (under_way_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return;
    under_way_.get();
  }
  start(report);
}

void Checkpointer::write_now(const BuildReport& report) {
  if (under_way_.valid()) under_way_.get();
  start(report);
  under_way_.get();
}

void Checkpointer::start(const BuildReport& report) {
  last_start_ = std::chrono::steady_clock::now();
  // The sums of now; tiles and borders that come while the work is under way may be safe too, but
  // are not counted.
  under_way_ = std::async(
      std::launch::async, [this, tiles_done = report.tiles, state = write_report_state(report)] {
        sink_.sync();
        borders_.seal();
        record_.add_tiles({.tiles_done = tiles_done,
                           .border_segments = count_border_segments(record_.folder()),
                           .report_state = state});
      });
}

}  // namespace qmpipe
