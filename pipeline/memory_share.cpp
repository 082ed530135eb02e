#include "pipeline/memory_share.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <limits>
#include <optional>

#include "formats/errors.h"
#include "formats/hdf5_lattice_store.h"

namespace qmpipe {
namespace {

constexpr std::int64_t kBlockBytes =
    std::int64_t{kBlockPosts} * kBlockPosts * static_cast<std::int64_t>(sizeof(float));
// The index of the store on disk.
constexpr std::int64_t kIndexBytesPerBlock = 112;

// Without a limit of the user's, what the machine has: running out of it would end the process
// without a word.
std::int64_t effective_limit(std::int64_t limit_bytes) {
  if (limit_bytes > 0) return limit_bytes;
  return static_cast<std::int64_t>(sysconf(_SC_PHYS_PAGES)) / 10 * 9 * sysconf(_SC_PAGESIZE);
}

MemoryNeeds needs_of(const SurveyOptions& survey, const std::vector<RasterInfo>& sources) {
  MemoryNeeds needs{.threads = survey.threads};
  for (const RasterInfo& source : sources) {
    // GDAL keeps blocks in the band's type, eight bytes a pixel at most.
    needs.source_block_bytes =
        std::max(needs.source_block_bytes, source.block_width * source.block_height * 8);
  }
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
  const Hdf5LatticeOptions store;
  return bytes + 3 * store.segment_bytes + store.cache_bytes + on_disk * kIndexBytesPerBlock;
}

}  // namespace

MemoryShare share_memory(std::int64_t limit_bytes, const SurveyOptions& survey,
                         const std::vector<RasterInfo>& sources, std::int32_t deepest_memory_zoom) {
  const std::int64_t limit = effective_limit(limit_bytes);
  const std::int32_t sampling_zoom = chosen_sampling_zoom(survey, sources);
  MemoryNeeds needs = needs_of(survey, sources);
  std::vector<std::int64_t> blocks;
  for (std::int32_t zoom = 0; zoom <= sampling_zoom; ++zoom) {
    blocks.push_back(expected_blocks(survey.scheme, zoom, sources));
    needs.tiles += blocks.back();
  }

  std::optional<MemoryShare> tight;
  std::int64_t least = std::numeric_limits<std::int64_t>::max();
  for (std::int32_t last = std::min(sampling_zoom, deepest_memory_zoom); last >= -1; --last) {
    needs.lattice_bytes = lattice_memory(blocks, last);
    MemoryShare share{.plan = plan_memory(limit, needs), .last_memory_zoom = last};
    for (std::int32_t zoom = last + 1; zoom <= sampling_zoom; ++zoom) {
      share.store_bytes += blocks[static_cast<std::size_t>(zoom)] * kBlockBytes;
    }
    least = std::min(least, share.plan.smallest_limit_bytes);
    if (!share.plan.fits) continue;
    if (needs.lattice_bytes <= limit / 2) return share;
    if (!tight) tight = share;
  }
  if (tight) return *tight;
  throw UsageError(fmt::format(
      "--memory: this work (sampling zoom {}) needs {} MiB or more, and the limit is {} MiB{}; "
      "give more, or less input, or a smaller --max-zoom where it is deeper than the pixels",
      sampling_zoom, (least + (1LL << 20U) - 1) >> 20U, limit >> 20U,
      limit_bytes == 0 ? " (nine tenths of this machine's memory)" : ""));
}

}  // namespace qmpipe
