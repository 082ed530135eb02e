#include "formats/source_pool.h"

#include <sys/resource.h>

#include <algorithm>
#include <utility>

#include "formats/errors.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

// The output, the stores, the libraries' own.
constexpr std::int64_t kOtherFiles = 200;
// The raster, a side file of it, PROJ's database.
constexpr std::int64_t kFilesPerSource = 3;
// A block of posts touches a few rasters, and a thread's next block most often the same ones.
constexpr std::int64_t kFewSources = 4;
constexpr std::int64_t kManySources = 64;

// The CRS is taken over from the first opening, and what that was is not looked at again.
bool is_the_same(const RasterInfo& a, const RasterInfo& b) {
  return a.width == b.width && a.height == b.height && a.block_width == b.block_width &&
         a.block_height == b.block_height && a.type_name == b.type_name && a.plane == b.plane;
}

}  // namespace

SourcePool::SourcePool(std::shared_ptr<const std::vector<RasterInfo>> infos, OpenOptions options,
                       std::size_t most_open)
    : infos_(std::move(infos)), options_(std::move(options)), most_open_(most_open) {
  QMPIPE_CHECK(most_open >= 1);
}

std::unique_ptr<RasterSource> SourcePool::open(std::size_t number) const {
  const RasterInfo& info = this->info(number);
  OpenOptions options = options_;
  options.number = static_cast<std::uint32_t>(number);
  options.placement = info.placement;
  std::unique_ptr<RasterSource> source = RasterSource::open(info.path, options);
  if (!is_the_same(source->info(), info)) {
    throw IoError("cannot go on reading", info.path,
                  "its size, its type or its place is another than at the start of the run",
                  "do not write to the input while it is read; run again");
  }
  return source;
}

SourcePool::Opened& SourcePool::opened(std::size_t number) {
  QMPIPE_CHECK(number < size());
  ++asked_;
  auto found = std::find_if(opened_.begin(), opened_.end(),
                            [number](const Opened& one) { return one.number == number; });
  if (found == opened_.end()) {
    if (opened_.size() < most_open_) {
      found = opened_.emplace(opened_.end());
    } else {
      found = std::min_element(
          opened_.begin(), opened_.end(),
          [](const Opened& a, const Opened& b) { return a.last_asked < b.last_asked; });
      // Before the other is opened, which could be one file too many.
      found->source.reset();
      found->grid.reset();
    }
    // Of no raster, until the one is open.
    found->number = size();
    found->source = open(number);
    found->number = number;
  }
  found->last_asked = asked_;
  return *found;
}

const RasterSource& SourcePool::source(std::size_t number) { return *opened(number).source; }

const RasterGrid& SourcePool::grid(std::size_t number) {
  Opened& one = opened(number);
  if (!one.grid) one.grid.emplace(info(number));
  return *one.grid;
}

std::size_t sources_open_at_once(std::int32_t threads) {
  QMPIPE_CHECK(threads >= 1);
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) {
    return kManySources;
  }
  const std::int64_t files = static_cast<std::int64_t>(limit.rlim_cur) - kOtherFiles;
  return static_cast<std::size_t>(
      std::clamp(files / (kFilesPerSource * threads), kFewSources, kManySources));
}

}  // namespace qmpipe
