// A made-up planet: continents with shelves and deep sea, plains, mountain chains with detail at
// all scales. For demos, tests and benchmarks that need a DEM of any size.
//
// Guarantees: a height is a pure function of (seed, pixel size, longitude, latitude), the same bits
// on every machine; it goes smoothly across the antimeridian and the poles; features smaller than
// about a pixel and a half are left out, so that nothing aliases. Heights lie in [-11000, 9000] m.
// A SynthTerrain is used by one thread at a time (it remembers where it was).
#pragma once

#include <cstdint>
#include <memory>
#include <span>

namespace qmpipe {

struct SynthTerrainOptions {
  std::uint32_t seed = 1;
  double pixel_deg = 0.01;  // REQUIRES: > 0
  // Part of the posts that are void, in holes of some ten pixels. REQUIRES: 0 .. 1.
  double void_share = 0;
  std::int16_t void_value = -32768;
};

class SynthTerrain {
 public:
  explicit SynthTerrain(const SynthTerrainOptions& options);
  ~SynthTerrain();
  SynthTerrain(const SynthTerrain&) = delete;
  SynthTerrain& operator=(const SynthTerrain&) = delete;

  // Heights in whole metres along a parallel. Fastest when neighbours in the list are neighbours on
  // the globe. REQUIRES: heights_m.size() == longitudes_deg.size().
  void sample_row(double latitude_deg, std::span<const double> longitudes_deg,
                  std::span<std::int16_t> heights_m);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace qmpipe
