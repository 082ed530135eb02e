#include "stages/synth/synth_terrain.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "scheduler/check.h"
#include "scheduler/elementary.h"
#include "stages/synth/gradient_noise.h"

namespace qmpipe {
namespace {

float smooth_step(float low, float high, float value) {
  const float t = std::clamp((value - low) / (high - low), 0.0F, 1.0F);
  return t * t * (3 - 2 * t);
}

struct Octave {
  GradientNoise noise;
  float weight = 1;  // 0 .. 1 as the octave's features grow past the pixel
};

// Doubling frequencies, as far as the pixel carries them.
std::vector<Octave> octaves(std::uint32_t seed, double first_frequency, int most,
                            double pixel_rad) {
  std::vector<Octave> result;
  double frequency = first_frequency;
  for (int k = 0; k < most; ++k, frequency *= 2) {
    const double weight = std::clamp(1 / (frequency * pixel_rad) - 1, 0.0, 1.0);
    if (weight <= 0) break;
    result.push_back({.noise = {mixed(seed + static_cast<std::uint32_t>(k)), frequency},
                      .weight = static_cast<float>(weight)});
  }
  return result;
}

using Values = std::vector<float>;

// The sum of octaves whose amplitudes fall by `gain`.
void add_fractal(std::vector<Octave>& layers, const NoisePoints& points, float gain, Values& sum) {
  sum.assign(points.size(), 0.0F);
  Values noise(points.size());
  float amplitude = 1;
  for (Octave& octave : layers) {
    octave.noise.sample(points, noise);
    const float factor = amplitude * octave.weight;
    for (std::size_t k = 0; k < noise.size(); ++k) sum[k] += factor * noise[k];
    amplitude *= gain;
  }
}

// What the detailed octaves add up to, shaped in two ways.
struct Relief {
  Values hills;   // about -1 .. 1
  Values ridges;  // about 0 .. 1, sharp crests
};

// Ridged multifractal (Musgrave): detail grows on crests and stays away from valleys.
void add_relief(std::vector<Octave>& layers, const NoisePoints& points, Relief& relief) {
  // Down to features of some 15 km all are about as high; below, they fall off as real relief does.
  constexpr std::size_t kBroadOctaves = 6;
  constexpr float kBroadGain = 0.9F;
  constexpr float kHillGain = 0.5F;
  constexpr float kRidgeGain = 0.5F;
  const std::size_t count = points.size();
  relief.hills.assign(count, 0.0F);
  relief.ridges.assign(count, 0.0F);
  Values crest(count, 1.0F);
  Values noise(count);
  float hill = 0.3F;
  float ridge = 0.2F;
  for (std::size_t level = 0; level < layers.size(); ++level) {
    Octave& octave = layers[level];
    octave.noise.sample(points, noise);
    const float hill_factor = hill * octave.weight;
    // An octave that fades out takes its mean with it.
    const float ridge_factor = ridge * octave.weight;
    for (std::size_t k = 0; k < count; ++k) {
      relief.hills[k] += hill_factor * noise[k];
      const float sharp = 1 - std::abs(noise[k] * octave.weight);
      const float signal = sharp * sharp * crest[k];
      relief.ridges[k] += ridge_factor * signal;
      crest[k] = std::min(std::max(2.0F * signal, 0.2F), 1.0F);
    }
    const bool is_broad = level + 1 < kBroadOctaves;
    hill *= is_broad ? kBroadGain : kHillGain;
    ridge *= is_broad ? kBroadGain : kRidgeGain;
  }
}

struct Ground {
  float land = 0;  // above 0 is land
  float belt = 0;  // 1 in the middle of a mountain chain
  float hills = 0;
  float ridges = 0;
};

float sea_floor_m(const Ground& g) {
  const float depth = -g.land;
  const float shelf =
      -170.0F * smooth_step(0, 0.06F, depth) + 30.0F * g.hills * smooth_step(0, 0.1F, depth);
  const float abyss = -3700.0F - 1100.0F * smooth_step(0.3F, 0.9F, depth) +
                      1500.0F * g.belt * g.ridges + 700.0F * g.hills;
  return shelf + smooth_step(0.05F, 0.30F, depth) * abyss;
}

float dry_land_m(const Ground& g) {
  const float inland = smooth_step(0, 0.18F, g.land);
  const float plain = 15.0F * smooth_step(0, 0.02F, g.land) + 700.0F * g.land * g.land +
                      inland * (120.0F + 260.0F * g.hills);
  return plain + inland * g.belt * (350.0F + 4600.0F * g.ridges * g.ridges + 900.0F * g.ridges);
}

constexpr std::uint32_t kContinents = 0x1000;
constexpr std::uint32_t kWarp = 0x2000;
constexpr std::uint32_t kChains = 0x3000;
constexpr std::uint32_t kDetail = 0x4000;
constexpr std::uint32_t kHoles = 0x5000;
constexpr float kHoleGain = 0.6F;

}  // namespace

struct SynthTerrain::Impl {
  SynthTerrainOptions options;
  std::vector<Octave> continents;
  std::array<std::vector<Octave>, 3> warp;
  std::vector<Octave> chains;
  std::vector<Octave> detail;
  std::vector<Octave> holes;
  float hole_threshold = 0;
  // Buffers kept between rows.
  NoisePoints points;
  NoisePoints bent;
  Values land;
  Values chain;
  Values depth;
  Relief relief;

  void place_row(double latitude_deg, std::span<const double> longitudes_deg);
  void bend_row();
  float height_m(std::size_t k) const;
  float threshold_for_share();
};

void SynthTerrain::Impl::place_row(double latitude_deg, std::span<const double> longitudes_deg) {
  const SinCos latitude = sin_cos_deg(latitude_deg);
  points.resize(longitudes_deg.size());
  for (std::size_t k = 0; k < longitudes_deg.size(); ++k) {
    const SinCos longitude = sin_cos_deg(longitudes_deg[k]);
    points.axes[0][k] = latitude.cos * longitude.cos;
    points.axes[1][k] = latitude.cos * longitude.sin;
    points.axes[2][k] = latitude.sin;
  }
}

// Domain warping: without it chains and coasts look like noise.
void SynthTerrain::Impl::bend_row() {
  bent = points;
  Values& shift = depth;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    add_fractal(warp[axis], points, 0.5F, shift);
    for (std::size_t k = 0; k < shift.size(); ++k) {
      bent.axes[axis][k] += 0.05 * static_cast<double>(shift[k]);
    }
  }
}

float SynthTerrain::Impl::height_m(std::size_t k) const {
  // The coast gets its bays from the hills.
  const Ground ground{.land = land[k] - 0.13F + 0.10F * relief.hills[k],
                      .belt = smooth_step(0.62F, 0.98F, 1 - std::abs(chain[k])),
                      .hills = relief.hills[k],
                      .ridges = relief.ridges[k]};
  return ground.land < 0 ? sea_floor_m(ground) : dry_land_m(ground);
}

// The quantile of the holes' noise, measured at fixed places.
float SynthTerrain::Impl::threshold_for_share() {
  constexpr std::size_t kPlaces = 16384;
  std::uint32_t word = mixed(options.seed ^ kHoles);
  points.resize(kPlaces);
  for (std::vector<double>& axis : points.axes) {
    for (double& value : axis) {
      word = mixed(word + 0x9E3779B9U);
      value = 2.0 * word / 4294967296.0 - 1.0;
    }
  }
  add_fractal(holes, points, kHoleGain, depth);
  std::sort(depth.begin(), depth.end());
  const auto rank = static_cast<std::size_t>(options.void_share * static_cast<double>(kPlaces));
  return depth[std::min(rank, kPlaces - 1)];
}

SynthTerrain::SynthTerrain(const SynthTerrainOptions& options) : impl_(std::make_unique<Impl>()) {
  QMPIPE_CHECK(options.pixel_deg > 0 && options.void_share >= 0 && options.void_share <= 1);
  const double pixel_rad = options.pixel_deg * (std::numbers::pi / 180);
  const std::uint32_t seed = mixed(options.seed);
  impl_->options = options;
  impl_->continents = octaves(seed ^ kContinents, 1.3, 4, pixel_rad);
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    impl_->warp[axis] = octaves(seed ^ (kWarp + 64 * axis), 6, 1, pixel_rad);
  }
  impl_->chains = octaves(seed ^ kChains, 3.1, 2, pixel_rad);
  impl_->detail = octaves(seed ^ kDetail, 12, 18, pixel_rad);
  // Holes a dozen pixels wide; on coarse grids the pixel itself limits them.
  impl_->holes = octaves(seed ^ kHoles, 1 / (16 * pixel_rad), 3, pixel_rad);
  impl_->hole_threshold = impl_->threshold_for_share();
}

SynthTerrain::~SynthTerrain() = default;

void SynthTerrain::sample_row(double latitude_deg, std::span<const double> longitudes_deg,
                              std::span<std::int16_t> heights_m) {
  QMPIPE_CHECK(heights_m.size() == longitudes_deg.size());
  Impl& impl = *impl_;
  impl.place_row(latitude_deg, longitudes_deg);
  impl.bend_row();
  add_fractal(impl.continents, impl.bent, 0.55F, impl.land);
  add_fractal(impl.chains, impl.bent, 0.4F, impl.chain);
  add_relief(impl.detail, impl.bent, impl.relief);
  for (std::size_t k = 0; k < heights_m.size(); ++k) {
    const float height = std::clamp(impl.height_m(k), -11000.0F, 9000.0F);
    // Cutting off the fraction of a positive number rounds it.
    heights_m[k] = static_cast<std::int16_t>(static_cast<std::int32_t>(height + 11000.5F) - 11000);
  }
  const double share = impl.options.void_share;
  if (share <= 0) return;
  add_fractal(impl.holes, impl.points, kHoleGain, impl.depth);
  for (std::size_t k = 0; k < heights_m.size(); ++k) {
    const bool is_hole = share >= 1 || impl.depth[k] < impl.hole_threshold;
    if (is_hole) heights_m[k] = impl.options.void_value;
  }
}

}  // namespace qmpipe
