#include "stages/posts/sampling.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "formats/heights/void_height.h"
#include "formats/sources/grid_pixels.h"
#include "scheduler/check.h"
#include "stages/posts/post_positions.h"

namespace qmpipe {
namespace {

// Bounds of what one read may ask for, and of the positions held at a time; results do not depend
// on either.
constexpr std::int64_t kLargestReadPixels = 4'000'000;
constexpr std::int32_t kLargestBlockPosts = 512;
constexpr std::int32_t kPolePosts = 64;

// Part of the block of posts in hand, and where its posts are in the caller's rows.
struct Part {
  std::size_t column = 0;
  std::size_t row = 0;
  std::size_t width = 0;
  std::size_t height = 0;
};

// Posts whose columns do not leave the lattice, and the caller's values for them.
struct Strip {
  PostWindow posts;
  std::span<float> out;  // from the strip's first post to its last, in the caller's rows
  std::size_t stride = 0;

  std::span<float> row(std::size_t r, std::size_t column, std::size_t width) const {
    return out.subspan(r * stride + column, width);
  }
};

// Rasters of one grid that follow each other in the order of priority: they are sampled at once.
struct PixelRun {
  std::size_t first = 0;
  std::size_t last = 0;
  std::size_t grid = 0;
};

RasterShape shape_of(const GridInfo& grid) {
  return {.width = grid.width, .height = grid.height, .wraps_columns = grid.wraps_columns};
}

bool is_full(const Strip& block) {
  const auto width = static_cast<std::size_t>(block.posts.width_posts);
  const auto height = static_cast<std::size_t>(block.posts.height_posts);
  for (std::size_t r = 0; r < height; ++r) {
    const std::span<const float> row = block.row(r, 0, width);
    if (std::any_of(row.begin(), row.end(), [](float h) { return std::isnan(h); })) return false;
  }
  return true;
}

}  // namespace

struct Sampler::Impl {
  explicit Impl(SourcePool pool, Resampling method);

  SourcePool sources;
  GridPixels grids;
  std::vector<PixelRun> runs;
  Resampling resampling;
  // Buffers kept between calls.
  std::vector<PixelPoint> places;
  std::vector<double> pixels;
  // By zoom and row. A value is a pure function of both.
  std::map<std::pair<std::int32_t, std::int64_t>, float> pole_heights_m;

  bool touches(const PixelRun& run, const Lattice& lattice, const PostRange& range) const;
  void sample_strip(const Lattice& lattice, const Strip& strip);
  void sample_block(const PixelRun& run, const Lattice& lattice, const Strip& block);
  void sample_copies(const PixelRun& run, const Strip& block);
  void sample_part(const PixelRun& run, const Strip& block, const Part& part);
  void leave_out_known(const Strip& block);
  void leave_out_later(const PixelRun& run, const Strip& block, const Part& part,
                       const NeededPixels& needed);
  void fetch(const PixelRun& run, std::size_t last_raster, const PixelWindow& needed);
  std::span<PixelPoint> places_of(const Strip& block, const Part& part, std::size_t row);
  float pole_height_m(const Lattice& lattice, std::int64_t j);
};

Sampler::Impl::Impl(SourcePool pool, Resampling method)
    : sources(std::move(pool)), grids(sources), resampling(method) {
  for (std::size_t k = 0; k < sources.size(); ++k) {
    const std::size_t grid = grids.grid_of(k);
    if (runs.empty() || runs.back().grid != grid) runs.push_back({.first = k, .grid = grid});
    runs.back().last = k;
  }
}

bool Sampler::Impl::touches(const PixelRun& run, const Lattice& lattice,
                            const PostRange& range) const {
  for (std::size_t k = run.first; k <= run.last; ++k) {
    if (touches_bounds(sources.info(k), lattice, range)) return true;
  }
  return false;
}

// The needed window as if the grid went on beyond its edges.
void Sampler::Impl::fetch(const PixelRun& run, std::size_t last_raster, const PixelWindow& needed) {
  const GridInfo& info = sources.grid_info(run.first);
  pixels.resize(needed.size());
  const std::int64_t row0 = std::clamp<std::int64_t>(needed.row0, 0, info.height - 1);
  const std::int64_t row1 =
      std::clamp<std::int64_t>(needed.row0 + needed.height - 1, 0, info.height - 1);
  const std::span<double> first_row =
      std::span(pixels).subspan(static_cast<std::size_t>((row0 - needed.row0) * needed.width));
  std::int64_t done = 0;
  while (done < needed.width) {
    const std::int64_t wanted = needed.column0 + done;
    PixelWindow piece{.row0 = row0, .height = row1 - row0 + 1};
    const std::int64_t left = needed.width - done;
    if (info.wraps_columns) {
      piece.column0 = ((wanted % info.width) + info.width) % info.width;
      piece.width = std::min(left, info.width - piece.column0);
    } else {
      piece.column0 = std::clamp<std::int64_t>(wanted, 0, info.width - 1);
      // Outside the grid: its outermost pixel, one column at a time.
      piece.width = wanted == piece.column0 ? std::min(left, info.width - wanted) : 1;
    }
    grids.read(sources, run.grid, last_raster, piece,
               first_row.subspan(static_cast<std::size_t>(done)), needed.width);
    done += piece.width;
  }
  const auto row_at = [&](std::int64_t row) {
    return pixels.begin() + (row - needed.row0) * needed.width;
  };
  for (std::int64_t row = needed.row0; row < row0; ++row) {
    std::copy_n(row_at(row0), needed.width, row_at(row));
  }
  for (std::int64_t row = row1 + 1; row < needed.row0 + needed.height; ++row) {
    std::copy_n(row_at(row1), needed.width, row_at(row));
  }
}

std::span<PixelPoint> Sampler::Impl::places_of(const Strip& block, const Part& part,
                                               std::size_t row) {
  const auto width = static_cast<std::size_t>(block.posts.width_posts);
  return std::span(places).subspan((part.row + row) * width + part.column, part.width);
}

// A raster of another grid comes between those of this one: what stands on a pixel that only a later
// one has is not for this run. Between pixels that it has, the later ones count as neighbours.
void Sampler::Impl::leave_out_later(const PixelRun& run, const Strip& block, const Part& part,
                                    const NeededPixels& needed) {
  fetch(run, run.last, needed.window);
  const RasterShape shape = shape_of(sources.grid_info(run.first));
  std::vector<float> nearest(part.width);
  for (std::size_t r = 0; r < part.height; ++r) {
    const std::span<PixelPoint> row = places_of(block, part, r);
    std::fill(nearest.begin(), nearest.end(), kVoidHeight);
    resample(Resampling::kNearest, shape, {.needed = needed, .heights_m = pixels}, row, nearest);
    for (std::size_t k = 0; k < row.size(); ++k) {
      if (std::isnan(nearest[k])) row[k].column = std::numeric_limits<double>::quiet_NaN();
    }
  }
}

void Sampler::Impl::sample_part(const PixelRun& run, const Strip& block, const Part& part) {
  const RasterShape shape = shape_of(sources.grid_info(run.first));
  PlaceBounds bounds(shape);
  for (std::size_t r = 0; r < part.height; ++r) bounds.add(places_of(block, part, r));
  const std::optional<NeededPixels> needed = bounds.needed(resampling);
  if (!needed) return;
  const bool is_single = part.width == 1 && part.height == 1;
  if (needed->window.width * needed->window.height > kLargestReadPixels && !is_single) {
    Part first = part;
    Part second = part;
    if (part.width >= part.height) {
      first.width = part.width / 2;
      second.column += first.width;
      second.width -= first.width;
    } else {
      first.height = part.height / 2;
      second.row += first.height;
      second.height -= first.height;
    }
    sample_part(run, block, first);
    sample_part(run, block, second);
    return;
  }
  if (run.last < grids.last_raster(run.grid)) leave_out_later(run, block, part, *needed);
  fetch(run, grids.last_raster(run.grid), needed->window);
  for (std::size_t r = 0; r < part.height; ++r) {
    resample(resampling, shape, {.needed = *needed, .heights_m = pixels}, places_of(block, part, r),
             block.row(part.row + r, part.column, part.width));
  }
}

// Posts that have a height already.
void Sampler::Impl::leave_out_known(const Strip& block) {
  const auto width = static_cast<std::size_t>(block.posts.width_posts);
  const auto height = static_cast<std::size_t>(block.posts.height_posts);
  for (std::size_t r = 0; r < height; ++r) {
    const std::span<const float> row = block.row(r, 0, width);
    for (std::size_t k = 0; k < width; ++k) {
      if (!std::isnan(row[k]))
        places[r * width + k].column = std::numeric_limits<double>::quiet_NaN();
    }
  }
}

// A raster that goes round the globe more than once has a place twice: what is void in its middle may
// be valid a turn beside it.
void Sampler::Impl::sample_copies(const PixelRun& run, const Strip& block) {
  const GridInfo& info = sources.grid_info(run.first);
  const double turn = columns_round_globe(info);
  const double width = static_cast<double>(info.width);
  if (!(turn > 0)) return;
  double side = 1;
  for (double turns = 1; turns * turn + 0.5 < width; ++turns) {
    for (const double steps : {2 * turns - 1, 2 * turns}) {
      if (is_full(block)) return;
      leave_out_known(block);
      for (PixelPoint& place : places) place.column += side * steps * turn;
      side = -side;
      sample_part(run, block,
                  {.width = static_cast<std::size_t>(block.posts.width_posts),
                   .height = static_cast<std::size_t>(block.posts.height_posts)});
    }
  }
}

void Sampler::Impl::sample_block(const PixelRun& run, const Lattice& lattice, const Strip& block) {
  places.resize(block.posts.size());
  locate_posts(sources.grid(run.first), lattice, block.posts, places);
  leave_out_known(block);
  sample_part(run, block,
              {.width = static_cast<std::size_t>(block.posts.width_posts),
               .height = static_cast<std::size_t>(block.posts.height_posts)});
  sample_copies(run, block);
}

void Sampler::Impl::sample_strip(const Lattice& lattice, const Strip& strip) {
  const PostWindow& all = strip.posts;
  for (std::int32_t r = 0; r < all.height_posts; r += kLargestBlockPosts) {
    for (std::int32_t c = 0; c < all.width_posts; c += kLargestBlockPosts) {
      const PostWindow posts{.i0 = all.i0 + c,
                             .j0 = all.j0 + r,
                             .width_posts = std::min(kLargestBlockPosts, all.width_posts - c),
                             .height_posts = std::min(kLargestBlockPosts, all.height_posts - r)};
      const std::size_t start =
          static_cast<std::size_t>(r) * strip.stride + static_cast<std::size_t>(c);
      const Strip block{.posts = posts, .out = strip.out.subspan(start), .stride = strip.stride};
      const PostRange range{.i0 = posts.i0,
                            .j0 = posts.j0,
                            .i1 = posts.i0 + posts.width_posts - 1,
                            .j1 = posts.j0 + posts.height_posts - 1};
      for (const PixelRun& run : runs) {
        if (!touches(run, lattice, range)) continue;
        if (is_full(block)) break;
        sample_block(run, lattice, block);
      }
    }
  }
}

float Sampler::Impl::pole_height_m(const Lattice& lattice, std::int64_t j) {
  const std::pair<std::int32_t, std::int64_t> key(lattice.zoom(), j);
  if (const auto known = pole_heights_m.find(key); known != pole_heights_m.end()) {
    return known->second;
  }
  double sum = 0;
  int count = 0;
  for (std::int32_t k = 0; k < kPolePosts; ++k) {
    std::array<float, 1> height = {kVoidHeight};
    const PostWindow post{
        .i0 = k * (lattice.columns() / kPolePosts), .j0 = j, .width_posts = 1, .height_posts = 1};
    sample_strip(lattice, {.posts = post, .out = height, .stride = 1});
    if (std::isnan(height[0])) continue;
    sum += static_cast<double>(height[0]);
    ++count;
  }
  const float mean = count == 0 ? kVoidHeight : static_cast<float>(sum / count);
  pole_heights_m.emplace(key, mean);
  return mean;
}

Sampler::Sampler(SourcePool sources, Resampling resampling) {
  QMPIPE_CHECK(sources.size() > 0);
  impl_ = std::make_unique<Impl>(std::move(sources), resampling);
}

Sampler::~Sampler() = default;
Sampler::Sampler(Sampler&&) noexcept = default;

void Sampler::sample(const Lattice& lattice, const PostWindow& window, std::span<float> out) {
  QMPIPE_CHECK(out.size() == window.size());
  std::fill(out.begin(), out.end(), kVoidHeight);
  const std::int64_t j0 = std::max<std::int64_t>(window.j0, 0);
  const std::int64_t j1 = std::min(window.j0 + window.height_posts, lattice.rows());
  if (j0 >= j1) return;
  const auto stride = static_cast<std::size_t>(window.width_posts);
  const auto row_of = [&](std::int64_t j) {
    return out.subspan(static_cast<std::size_t>(j - window.j0) * stride);
  };
  // Cut where the columns wrap, so that a post is asked for under one name only.
  for (std::int32_t c = 0; c < window.width_posts;) {
    const std::int64_t i = lattice.wrap_column(window.i0 + c);
    const auto width = static_cast<std::int32_t>(
        std::min<std::int64_t>(window.width_posts - c, lattice.columns() - i));
    const PostWindow posts{.i0 = i,
                           .j0 = j0,
                           .width_posts = width,
                           .height_posts = static_cast<std::int32_t>(j1 - j0)};
    impl_->sample_strip(
        lattice,
        {.posts = posts, .out = row_of(j0).subspan(static_cast<std::size_t>(c)), .stride = stride});
    c += width;
  }
  for (const std::int64_t j : {std::int64_t{0}, lattice.rows() - 1}) {
    if (!lattice.is_pole_row(j) || j < j0 || j >= j1) continue;
    const std::span<float> row = row_of(j).first(stride);
    std::fill(row.begin(), row.end(), impl_->pole_height_m(lattice, j));
  }
}

bool Sampler::may_cover(const Lattice& lattice, const PostWindow& window) const {
  const PostRange range{.i0 = window.i0,
                        .j0 = std::max<std::int64_t>(window.j0, 0),
                        .i1 = window.i0 + window.width_posts - 1,
                        .j1 = std::min(window.j0 + window.height_posts, lattice.rows()) - 1};
  if (range.j0 > range.j1) return false;
  return std::any_of(impl_->runs.begin(), impl_->runs.end(),
                     [&](const PixelRun& run) { return impl_->touches(run, lattice, range); });
}

std::int32_t sampling_zoom_for(const TilingScheme& scheme, std::span<const RasterInfo> sources) {
  constexpr double kSlack = 1e-6;
  double finest_deg = 360;
  for (const RasterInfo& info : sources) finest_deg = std::min(finest_deg, info.pixel_deg);
  for (std::int32_t zoom = 0; zoom < kMaxZoom; ++zoom) {
    if (Lattice(scheme, zoom).column_spacing_deg() <= finest_deg * (1 + kSlack)) return zoom;
  }
  return kMaxZoom;
}

}  // namespace qmpipe
