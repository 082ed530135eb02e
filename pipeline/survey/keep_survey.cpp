#include "pipeline/survey/keep_survey.h"

#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <memory>

#include "formats/bytes/errors.h"
#include "formats/run_store/hdf5_lattice_store.h"
#include "pipeline/common/stopwatch.h"
#include "pipeline/survey/block_cover.h"

namespace qmpipe {
namespace {

void copy_blocks(const Survey& survey, const std::vector<BlockKey>& blocks, std::int32_t threads,
                 LatticeStore& disk) {
  tbb::task_arena arena(threads);
  arena.execute([&] {
    tbb::parallel_for(std::size_t{0}, blocks.size(), [&](std::size_t k) {
      const BlockKey& block = blocks[k];
      if (!survey.store->has_block(block)) return;
      std::vector<float> heights_m(kBlockSize);
      survey.store->read(Lattice(survey.scheme, block.zoom), posts_of(block), heights_m);
      disk.put_block(block, heights_m);
    });
  });
  disk.seal();
}

// One store at a time may use the folder: the one that is at work there, or a new one.
class DiskStore {
 public:
  DiskStore(const Survey& survey, const std::filesystem::path& folder) : store_(survey.disk) {
    if (store_ != nullptr) return;
    auto opened =
        open_hdf5_lattice_store(folder, survey.scheme, {.max_zoom = survey.sampling_zoom});
    if (!opened) {
      throw IoError("cannot keep the survey in", folder.string(), opened.error().message, "");
    }
    own_ = std::move(opened.value());
    store_ = own_.get();
  }
  LatticeStore& store() const { return *store_; }

 private:
  std::unique_ptr<LatticeStore> own_;
  LatticeStore* store_;
};

// The coarsest zoom worth keeping: the sampling zoom when it is cut off as well.
std::int32_t last_kept(const Survey& survey) {
  return std::min(survey.coarsest_done, survey.sampling_zoom);
}

void write_zooms(const Survey& survey, const MemoryShare& memory, RunRecord& record) {
  const DiskStore disk(survey, record.folder());
  std::vector<BlockKey> blocks =
      covered_blocks(survey.scheme, survey.sampling_zoom, survey.sources);
  for (std::int32_t zoom = survey.sampling_zoom; zoom >= last_kept(survey); --zoom) {
    if (zoom < survey.sampling_zoom) blocks = coarser_blocks(survey.scheme, blocks);
    if (zoom > memory.last_memory_zoom) continue;
    copy_blocks(survey, blocks, memory.plan.sampling_threads, disk.store());
    if (zoom >= survey.coarsest_done) record.add_surveyed(zoom, zoom_of(survey, zoom));
  }
}

}  // namespace

void keep_survey(const Survey& survey, const MemoryShare& memory, const SurveyPlace& place,
                 Progress& progress) {
  const bool is_on_disk = memory.last_memory_zoom < last_kept(survey);
  if (place.record == nullptr || is_on_disk || survey.seconds < place.keep_after_s) return;
  progress.note(fmt::format("keeping the survey, which took {}: ask again to stop without it",
                            duration_text(survey.seconds)));
  try {
    write_zooms(survey, memory, *place.record);
  } catch (const IoError& error) {
    progress.note(fmt::format("the survey is not kept: {}", error.what()));
  }
}

}  // namespace qmpipe
