// One tile's way through the stages: window, mesh, finish, encode. What the graph's nodes call, one
// function a node; each is pure but for the clock.
//
// const use is safe from several threads.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "formats/bytes/gzip.h"
#include "formats/tile/quantized_mesh.h"
#include "pipeline/common/stopwatch.h"
#include "pipeline/recipe/recipe.h"
#include "scheduler/wavefront.h"
#include "stages/finish/tile_error.h"
#include "stages/posts/heightfield.h"

namespace qmpipe {

enum class Stage : std::uint8_t { kWindow, kMesh, kFinish, kEncode, kSink };
inline constexpr std::size_t kStageCount = 5;
inline constexpr std::array<const char*, kStageCount> kStageNames = {"window", "mesh", "finish",
                                                                     "encode", "sink"};
using StageSeconds = std::array<double, kStageCount>;

// A tile under way. Each stage frees what the later ones do not need.
struct TileWork {
  TileIndex index = kNoTile;
  TileKey key;
  std::unique_ptr<PostGrid> grid;
  WindowHeights window;          // with a halo of one post
  std::vector<float> heights_m;  // the tile's own 257 x 257 posts
  std::vector<std::uint8_t> valid;
  HeightSteps steps;
  Tin tin;
  QuantizedMesh mesh;
  std::vector<std::uint8_t> bytes;  // as stored

  std::size_t vertices = 0;
  std::size_t triangles = 0;
  std::size_t plain_bytes = 0;
  std::uint64_t content_hash = 0;  // of the key and the plain bytes
  ErrorSummary error;
  StageSeconds seconds{};
};

class TileBuilder {
 public:
  // REQUIRES: the references outlive this.
  TileBuilder(const Heightfield& heightfield, const Recipe& recipe)
      : heightfield_(heightfield), recipe_(recipe) {}

  void read_window(TileWork& work) const;
  // `fixed` as inherited; the mercator root's west and east sides are settled here.
  void simplify(TileWork& work, FixedBorders fixed, const PlannedTile& planned) const;
  void finish(TileWork& work) const;
  // `compressor` may be null for plain tiles.
  void encode_bytes(TileWork& work, GzipCompressor* compressor) const;

 private:
  const Heightfield& heightfield_;
  const Recipe& recipe_;
};

// Adds the time from its making to its end to one stage's seconds.
class StageClock {
 public:
  StageClock(TileWork& work, Stage stage)
      : seconds_(work.seconds.at(static_cast<std::size_t>(stage))) {}
  ~StageClock() { seconds_ += watch_.seconds(); }
  StageClock(const StageClock&) = delete;
  StageClock& operator=(const StageClock&) = delete;

 private:
  double& seconds_;
  Stopwatch watch_;
};

}  // namespace qmpipe
