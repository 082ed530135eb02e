#include "formats/sources/source_pool.h"

#include <sys/resource.h>

#include <algorithm>
#include <utility>

#include "formats/bytes/errors.h"
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
  return a.width == b.width && a.height == b.height && a.blocks.width == b.blocks.width &&
         a.blocks.height == b.blocks.height && a.band.type_name == b.band.type_name &&
         a.plane == b.plane;
}

// What is asked for, or the place that it may take: one of those that are free, else that of what was
// asked for longest ago.
template <class Kept, class IsWanted>
Kept& place_for(std::vector<Kept>& kept, std::size_t most, const IsWanted& is_wanted) {
  const auto found = std::find_if(kept.begin(), kept.end(), is_wanted);
  if (found != kept.end()) return *found;
  if (kept.size() < most) return kept.emplace_back();
  return *std::min_element(kept.begin(), kept.end(), [](const Kept& a, const Kept& b) {
    return a.last_asked < b.last_asked;
  });
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
  options.opened_name = info.opened_name;
  options.placement = info.placement;
  std::unique_ptr<RasterSource> source = RasterSource::open(info.path, options);
  if (!is_the_same(source->info(), info)) {
    throw IoError("cannot go on reading", info.path,
                  "its size, its type or its place is another than at the start of the run",
                  "do not write to the input while it is read; run again");
  }
  return source;
}

const RasterSource& SourcePool::source(std::size_t number) {
  QMPIPE_CHECK(number < size());
  Opened& one = place_for(opened_, most_open_,
                          [number](const Opened& opened) { return opened.number == number; });
  if (!one.source || one.number != number) {
    // Before the other is opened, which could be one file too many.
    one.source.reset();
    one.source = open(number);
    one.number = number;
  }
  one.last_asked = ++asked_;
  return *one.source;
}

const GridInfo& SourcePool::grid_info(std::size_t number) const {
  const RasterInfo& raster = info(number);
  return raster.part.whole ? *raster.part.whole : raster;
}

const RasterGrid& SourcePool::grid(std::size_t number) {
  const GridInfo& info = grid_info(number);
  Placed& one = place_for(placed_, most_open_,
                          [&info](const Placed& placed) { return placed.info == &info; });
  if (one.info != &info) {
    one.info = nullptr;
    one.grid = std::make_unique<RasterGrid>(info);
    one.info = &info;
  }
  one.last_asked = ++asked_;
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
