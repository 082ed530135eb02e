// How many posts a second does the Sampler read, by CRS and resampling?
//
// One iteration is one block of 256 x 256 posts, as the survey asks for them; GDAL's cache holds the
// whole raster, so this is arithmetic and not decompression (stores_bench.cpp has that).
#include <benchmark/benchmark.h>

#include <cmath>
#include <string>
#include <vector>

#include "formats/run_store/lattice_store.h"
#include "perf/bench_terrain.h"
#include "perf/register_benchmarks.h"
#include "tests/support/raster_fixture.h"

namespace qmpipe::perf {
namespace {

struct SampledRaster {
  std::string name;
  std::string path;
  // Keeps a made-up one on disk.
  std::shared_ptr<BenchDem> dem;
};

// The blocks that lie wholly within the raster's bounds.
std::vector<PostWindow> blocks_of(const RasterInfo& info, const Lattice& lattice) {
  const RectangleDeg& box = info.bounds_deg;
  const auto first = [](double post) {
    return static_cast<std::int64_t>(std::ceil(post / kBlockPosts)) * kBlockPosts;
  };
  std::vector<PostWindow> blocks;
  for (std::int64_t j = first(lattice.row_at(box.south_deg));
       static_cast<double>(j + kBlockPosts) <= lattice.row_at(box.north_deg); j += kBlockPosts) {
    for (std::int64_t i = first(lattice.column_at(box.west_deg));
         static_cast<double>(i + kBlockPosts) <= lattice.column_at(box.east_deg);
         i += kBlockPosts) {
      blocks.push_back({.i0 = i, .j0 = j, .width_posts = kBlockPosts, .height_posts = kBlockPosts});
    }
  }
  return blocks;
}

void sample_blocks(benchmark::State& state, const SampledRaster& raster, Resampling resampling) {
  set_gdal_cache_bytes(std::int64_t{256} << 20U);
  const RasterInfo info = RasterSource::open(raster.path)->info();
  const TilingScheme scheme(Projection::kGeodetic);
  const Lattice lattice(scheme, sampling_zoom_for(scheme, std::span(&info, 1)));
  const std::vector<PostWindow> blocks = blocks_of(info, lattice);
  const auto sampler = open_sampler(raster.path, resampling);
  std::vector<float> heights_m(kBlockSize);
  for (const PostWindow& block : blocks) sampler->sample(lattice, block, heights_m);
  std::size_t next = 0;
  for (auto _ : state) {
    sampler->sample(lattice, blocks.at(next), heights_m);
    benchmark::DoNotOptimize(heights_m.data());
    next = (next + 1) % blocks.size();
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(heights_m.size()));
}

}  // namespace

void register_benchmarks() {
  const std::int32_t side = is_small_run() ? 2 : 4;
  std::vector<SampledRaster> rasters;
  for (const DemKind kind : {DemKind::kInt16Deflate, DemKind::kUtmDeflate}) {
    const auto dem = std::make_shared<BenchDem>(kind, side, side);
    rasters.push_back({.name = kind == DemKind::kUtmDeflate ? "synth_utm" : "synth_geographic",
                       .path = dem->path(),
                       .dem = dem});
  }
  for (const char* file : {"N43E007.hgt.zip", "N44E005_UTM.tif"}) {
    const auto path = testing::real_data(file);
    if (path) rasters.push_back({.name = file, .path = *path, .dem = nullptr});
  }
  struct Method {
    const char* name;
    Resampling resampling;
  };
  for (const SampledRaster& raster : rasters) {
    for (const Method& method :
         {Method{"bilinear", Resampling::kBilinear}, Method{"cubic", Resampling::kCubic},
          Method{"nearest", Resampling::kNearest}}) {
      benchmark::RegisterBenchmark(("sample/" + raster.name + "/" + method.name).c_str(),
                                   [raster, method](benchmark::State& state) {
                                     sample_blocks(state, raster, method.resampling);
                                   })
          ->Unit(benchmark::kMicrosecond);
    }
  }
}

}  // namespace qmpipe::perf
