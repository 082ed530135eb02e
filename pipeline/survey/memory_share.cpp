#include "pipeline/survey/memory_share.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <numeric>

#include "formats/bytes/errors.h"
#include "formats/mbtiles/mbtiles.h"
#include "formats/run_store/hdf5_lattice_store.h"
#include "pipeline/common/process_memory.h"
#include "pipeline/survey/block_cover.h"
#include "pipeline/survey/sampling_order.h"

namespace qmpipe {
namespace {

MemoryNeeds needs_of(const SurveyChoice& survey, const std::vector<RasterInfo>& sources,
                     std::int64_t limit_bytes) {
  MemoryNeeds needs{.threads = survey.threads};
  // Every thread has its own handles, on as many sources at a time as it may have open.
  std::vector<std::int64_t> handles;
  for (const RasterInfo& source : sources) {
    needs.source_block_bytes = std::max(needs.source_block_bytes, source.blocks.cached_bytes);
    handles.push_back(source.blocks.handle_bytes);
  }
  std::sort(handles.begin(), handles.end(), std::greater<>());
  handles.resize(std::min(handles.size(), survey.open_sources));
  needs.source_handle_bytes = std::accumulate(handles.begin(), handles.end(), std::int64_t{0});
  // The first is among what every thread takes.
  needs.source_handle_bytes += static_cast<std::int64_t>(handles.size() - 1) * kOpenSourceBytes;
  const Lattice lattice(survey.scheme, chosen_sampling_zoom(survey, sources));
  // The rest is better used for tiles in flight, and for the system's own cache of the files.
  needs.source_front_bytes = std::min(
      front_bytes(lattice, sources, survey.threads, lattice.scheme().columns(lattice.zoom())),
      limit_bytes / 4);
  return needs;
}

// The memory of the lattice when zooms up to `last` are in memory and deeper ones on disk.
std::int64_t lattice_memory(const std::vector<std::int64_t>& blocks, std::int32_t last) {
  std::int64_t bytes = 0;
  std::int64_t on_disk = 0;
  for (std::size_t zoom = 0; zoom < blocks.size(); ++zoom) {
    if (static_cast<std::int32_t>(zoom) <= last) {
      bytes += blocks[zoom] * kBlockBytes;
    } else {
      on_disk += blocks[zoom];
    }
  }
  if (on_disk == 0) return bytes;
  return bytes + lattice_store_memory_bytes({}, on_disk);
}

// So many rows of blocks do tiles touch between the first and the last time a block is read: the
// schedule goes back by one row for every two that it goes on.
constexpr std::int64_t kRowsOfBlocks = 5;

// What the rows take at the deepest zoom.
std::int64_t rows_of_blocks_bytes(const Lattice& lattice, const std::vector<RasterInfo>& sources) {
  std::int64_t across = 0;
  for (const RasterInfo& source : sources) across += covered_span(lattice, source).width;
  across = std::min<std::int64_t>(across, lattice.columns() / kBlockPosts);
  return kRowsOfBlocks * across * kBlockBytes;
}

// Gives memory that nobody else needs to the cache of the store on disk; a part stays free, because
// the other numbers are estimates.
void widen_block_cache(MemoryShare& share, std::int64_t limit_bytes, std::int64_t wanted_bytes) {
  if (share.store_bytes == 0) return;
  const std::int64_t least_bytes = Hdf5LatticeOptions().cache_bytes;
  const std::int64_t free_bytes = limit_bytes - limit_bytes / 8 - share.plan.expected_peak_bytes;
  share.block_cache_bytes =
      std::clamp(wanted_bytes, least_bytes, least_bytes + std::max<std::int64_t>(0, free_bytes));
  share.plan.expected_peak_bytes += share.block_cache_bytes - least_bytes;
}

}  // namespace

MemoryDivisions::MemoryDivisions(const MemoryRequest& request, const SurveyChoice& choice,
                                 const std::vector<RasterInfo>& sources)
    : limit_bytes_(memory_limit_bytes(request.limit_bytes)),
      is_limit_given_(request.limit_bytes != 0),
      sampling_zoom_(chosen_sampling_zoom(choice, sources)) {
  MemoryNeeds needs = needs_of(choice, sources, limit_bytes_);
  needs.simplify_bytes = request.simplify_bytes;
  front_bytes_ = needs.source_front_bytes;
  rows_of_blocks_bytes_ = rows_of_blocks_bytes(Lattice(choice.scheme, sampling_zoom_), sources);
  std::vector<std::int64_t> blocks;
  for (std::int32_t zoom = 0; zoom <= sampling_zoom_; ++zoom) {
    blocks.push_back(expected_blocks(choice.scheme, zoom, sources));
    needs.tiles += blocks.back();
  }
  if (request.output == TileForm::kMbtiles) {
    needs.output_bytes = kMbtilesSinkBytes + needs.tiles * kMbtilesSinkBytesPerTile;
  }

  least_limit_bytes_ = std::numeric_limits<std::int64_t>::max();
  for (std::int32_t last = sampling_zoom_; last >= -1; --last) {
    needs.lattice_bytes = lattice_memory(blocks, last);
    MemoryShare share{.plan = plan_memory(limit_bytes_, needs), .last_memory_zoom = last};
    for (std::int32_t zoom = last + 1; zoom <= sampling_zoom_; ++zoom) {
      share.store_bytes += blocks[static_cast<std::size_t>(zoom)] * kBlockBytes;
    }
    least_limit_bytes_ = std::min(least_limit_bytes_, share.plan.smallest_limit_bytes);
    if (share.plan.fits) divisions_.push_back({share, needs.lattice_bytes});
  }
  if (divisions_.empty()) refuse();
}

// The most of the lattice in memory that leaves the source its cache: a lattice on disk is packed
// once, but strips that the cache cannot hold are unpacked for every block of posts.
const MemoryDivisions::Division& MemoryDivisions::chosen(std::int32_t deepest_memory_zoom) const {
  const auto first =
      std::find_if(divisions_.begin(), divisions_.end(), [=](const Division& division) {
        return division.share.last_memory_zoom <= deepest_memory_zoom;
      });
  if (first == divisions_.end()) refuse();
  // Half the front is a row of strips; what comes on top keeps threads from pushing each other out.
  for (const std::int64_t cache_bytes : {front_bytes_, front_bytes_ / 8 * 5, std::int64_t{0}}) {
    for (auto division = first; division != divisions_.end(); ++division) {
      if (division->lattice_bytes <= limit_bytes_ / 2 &&
          division->share.plan.source_cache_bytes >= cache_bytes) {
        return *division;
      }
    }
  }
  return *first;
}

MemoryShare MemoryDivisions::best(std::int32_t deepest_memory_zoom) const {
  MemoryShare share = chosen(deepest_memory_zoom).share;
  widen_block_cache(share, limit_bytes_, rows_of_blocks_bytes_);
  return share;
}

void MemoryDivisions::refuse() const {
  throw UsageError(fmt::format(
      "--memory: this work (sampling zoom {}) needs {} MiB or more, and the limit is {} MiB{}; "
      "give more, or less input, or a smaller --max-zoom where it is deeper than the pixels",
      sampling_zoom_, (least_limit_bytes_ + (1LL << 20U) - 1) >> 20U, limit_bytes_ >> 20U,
      is_limit_given_ ? "" : " (nine tenths of this machine's memory)"));
}

}  // namespace qmpipe
