#include "pipeline/survey/sampling_order.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "formats/run_store/lattice_store.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

// Resampling looks at a few pixels around a block's posts.
constexpr double kMarginPixels = 4;
// A thread that the system has put aside finds the others so many blocks of posts ahead, for each of
// them.
constexpr std::int32_t kBlocksAhead = 4;

// A source as the lattice sees it: where it lies, in blocks of posts, and what of it a block needs.
struct Footprint {
  std::int32_t first_x = 0;
  std::int32_t last_x = 0;
  std::int32_t first_y = 0;
  std::int32_t last_y = 0;
  double block_pixels = 0;  // along a side of a block of posts, at most
  std::int64_t columns = 0;
  std::int64_t rows = 0;
  double column_pixels = 0;
  double row_pixels = 0;
  std::int64_t cached_block_bytes = 0;
};

Footprint footprint_of(const Lattice& lattice, const RasterInfo& source) {
  const auto block = [](double post) {
    return static_cast<std::int32_t>(std::floor(post / kBlockPosts));
  };
  const std::int64_t width = std::max<std::int64_t>(1, source.blocks.cached_width);
  const std::int64_t height = std::max<std::int64_t>(1, source.blocks.cached_height);
  const RectangleDeg& box = source.bounds_deg;
  return {.first_x = block(lattice.column_at(box.west_deg)),
          .last_x = block(lattice.column_at(box.east_deg)),
          .first_y = block(lattice.row_at(box.south_deg)),
          .last_y = block(lattice.row_at(box.north_deg)),
          .block_pixels = kBlockPosts * lattice.column_spacing_deg() / source.pixel_deg,
          .columns = (source.width + width - 1) / width,
          .rows = (source.height + height - 1) / height,
          .column_pixels = static_cast<double>(width),
          .row_pixels = static_cast<double>(height),
          .cached_block_bytes = source.blocks.cached_bytes};
}

std::int32_t columns_of_blocks(const Lattice& lattice) {
  return lattice.scheme().columns(lattice.zoom());
}

// Source blocks that so many pixels in a row may touch, wherever they begin.
std::int64_t touched(double pixels, double block_pixels, std::int64_t most) {
  const double blocks = std::floor((pixels + kMarginPixels) / block_pixels) + 2;
  return blocks < static_cast<double>(most) ? static_cast<std::int64_t>(blocks) : most;
}

std::int64_t bytes_in_strip(const Footprint& source, std::int32_t width_blocks,
                            std::int32_t threads) {
  const std::int64_t rows = touched(source.block_pixels, source.row_pixels, source.rows);
  const std::int64_t across =
      touched(width_blocks * source.block_pixels, source.column_pixels, source.columns);
  // Some threads have begun the next rows of blocks while others finish one.
  const std::int32_t blocks_ahead = kBlocksAhead * threads;
  const std::int32_t rows_ahead = blocks_ahead / width_blocks;
  const std::int64_t ahead =
      rows_ahead * across + touched(blocks_ahead % width_blocks * source.block_pixels,
                                    source.column_pixels, source.columns);
  return std::min(rows * (across + ahead), source.rows * source.columns) *
         source.cached_block_bytes;
}

// Bytes that begin and end to count at a row of blocks.
using Changes = std::map<std::int32_t, std::int64_t>;

std::int64_t most_at_once(const Changes& changes) {
  std::int64_t bytes = 0;
  std::int64_t most = 0;
  for (const auto& [row, change] : changes) {
    bytes += change;
    most = std::max(most, bytes);
  }
  return most;
}

}  // namespace

std::int64_t front_bytes(const Lattice& lattice, const std::vector<RasterInfo>& sources,
                         std::int32_t threads, std::int32_t strip_blocks) {
  QMPIPE_CHECK(strip_blocks >= 1);
  const std::int32_t strips = (columns_of_blocks(lattice) + strip_blocks - 1) / strip_blocks;
  std::map<std::int32_t, Changes> changes_of_strip;
  for (const RasterInfo& info : sources) {
    const Footprint source = footprint_of(lattice, info);
    const auto strip_of = [strip_blocks](std::int32_t x) {
      return static_cast<std::int32_t>(
          std::floor(static_cast<double>(x) / static_cast<double>(strip_blocks)));
    };
    for (std::int32_t strip = strip_of(source.first_x); strip <= strip_of(source.last_x); ++strip) {
      const std::int32_t west = std::max(source.first_x, strip * strip_blocks);
      const std::int32_t east = std::min(source.last_x, (strip + 1) * strip_blocks - 1);
      const std::int64_t bytes = bytes_in_strip(source, east - west + 1, threads);
      Changes& changes = changes_of_strip[((strip % strips) + strips) % strips];
      changes[source.first_y] += bytes;
      changes[source.last_y + 1] -= bytes;
    }
  }
  std::int64_t most = 0;
  for (const auto& [strip, changes] : changes_of_strip) {
    most = std::max(most, most_at_once(changes));
  }
  return most;
}

std::int32_t widest_strip(const Lattice& lattice, const std::vector<RasterInfo>& sources,
                          std::int32_t threads, std::int64_t cache_bytes) {
  std::int32_t best = columns_of_blocks(lattice);
  std::int64_t smallest = front_bytes(lattice, sources, threads, best);
  for (std::int32_t strip = best / 2; strip >= 1 && smallest > cache_bytes; strip /= 2) {
    const std::int64_t bytes = front_bytes(lattice, sources, threads, strip);
    if (bytes >= smallest) continue;
    smallest = bytes;
    best = strip;
  }
  return best;
}

void sort_for_sampling(std::vector<TileKey>& blocks, std::int32_t strip_blocks) {
  QMPIPE_CHECK(strip_blocks >= 1);
  std::sort(blocks.begin(), blocks.end(), [strip_blocks](const TileKey& a, const TileKey& b) {
    return std::tuple(a.x / strip_blocks, -a.y, a.x) < std::tuple(b.x / strip_blocks, -b.y, b.x);
  });
}

}  // namespace qmpipe
