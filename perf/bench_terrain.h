// Terrain for the benchmarks: made-up DEMs as GeoTIFFs, and tiles sampled from them, or from a real
// DEM where there is one (QMPIPE_DATA), by the program's own Sampler.
//
// Guarantees: the same on every machine; constants fix it all. With QMPIPE_PERF_SMALL in the
// environment everything is as small as a smoke test wants it; such figures are not for comparing.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "scheduler/tile_key.h"
#include "stages/greedy/greedy.h"
#include "stages/posts/heightfield.h"
#include "stages/posts/sampling.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::perf {

// The sampling zoom of the made-up DEMs: their pixels are as wide as SRTM's, 3 seconds.
inline constexpr std::int32_t kDemZoom = 10;

bool is_small_run();

// How the file is packed: what others hand us, what `qmpipe synth` writes, and a projected one.
enum class DemKind { kInt16Deflate, kFloat32Deflate, kInt16Zstd, kUtmDeflate };
const char* name_of(DemKind kind);

// Mountains on a rectangle of tiles of kDemZoom, in a file of its own; 256 x 256 pixels a block.
// The file's outer edges are the rectangle's, so that a halo beyond it costs nobody a read.
class BenchDem {
 public:
  // Throws std::runtime_error when the file cannot be written.
  BenchDem(DemKind kind, std::int32_t columns, std::int32_t rows);

  const std::string& path() const { return path_; }
  // In the order of the mesh pass.
  const std::vector<TileKey>& tiles() const { return tiles_; }
  std::int64_t post_count() const;

 private:
  testing::TemporaryFolder folder_;
  std::string path_;
  std::vector<TileKey> tiles_;
};

std::unique_ptr<Sampler> open_sampler(const std::string& path, Resampling resampling);

// The terrain of one tile; voids are filled.
struct BenchTile {
  std::string name;
  TilingScheme scheme{Projection::kGeodetic};
  TileKey key;
  PostGrid grid;
  WindowHeights window;          // with a halo of one post
  std::vector<float> heights_m;  // the tile's own posts
};

// A made-up one, and a real one (the Maritime Alps) where the data is there.
std::vector<BenchTile> bench_tiles();

GreedyOptions options_for(const BenchTile& tile, double tolerance_m);
// Options that give about so many vertices: within a few per cent, as the terrain allows.
GreedyOptions options_for_vertices(const BenchTile& tile, std::size_t vertices);

}  // namespace qmpipe::perf
