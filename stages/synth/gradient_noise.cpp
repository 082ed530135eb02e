#include "stages/synth/gradient_noise.h"

#include <cstddef>

#include "scheduler/check.h"

namespace qmpipe {
namespace {

// Brings the usual values to [-1, 1].
constexpr float kGain = 1.5F;

// Its first and second derivatives vanish at 0 and 1, so that cells join smoothly.
inline float fade(float t) { return t * t * t * (t * (t * 6 - 15) + 10); }

inline float between(float a, float b, float part) { return a + (b - a) * part; }

// Ten bits of the word as a number in [-1, 1].
float component(std::uint32_t word, unsigned shift) {
  return static_cast<float>(static_cast<std::int32_t>((word >> shift) & 1023U)) * (2.0F / 1023.0F) -
         1.0F;
}

// Cells are made positive, because then cutting off the fraction is rounding down.
void split_axis(const std::vector<double>& axis, double frequency, std::vector<std::int32_t>& cells,
                std::vector<float>& parts) {
  const double offset = 2 * frequency + 1;
  cells.resize(axis.size());
  parts.resize(axis.size());
  for (std::size_t k = 0; k < axis.size(); ++k) {
    const double value = axis[k] * frequency + offset;
    const auto cell = static_cast<std::int32_t>(value);
    cells[k] = cell;
    parts[k] = static_cast<float>(value - cell);
  }
}

struct NoiseRun {
  const float* x = nullptr;
  const float* y = nullptr;
  const float* z = nullptr;
  float* out = nullptr;
  std::size_t size = 0;
};

// Points of one cell. The loop has no branches and shares the gradients: compilers make four at a
// time of it.
void sample_cell(const std::array<std::array<float, 8>, 3>& g, const NoiseRun& run) {
  for (std::size_t k = 0; k < run.size; ++k) {
    const float x = run.x[k];
    const float y = run.y[k];
    const float z = run.z[k];
    const auto slope = [&g, x, y, z](std::size_t c, float dx, float dy, float dz) {
      return g[0][c] * (x - dx) + g[1][c] * (y - dy) + g[2][c] * (z - dz);
    };
    const float u = fade(x);
    const float v = fade(y);
    const float w = fade(z);
    const float a = between(slope(0, 0, 0, 0), slope(1, 1, 0, 0), u);
    const float b = between(slope(2, 0, 1, 0), slope(3, 1, 1, 0), u);
    const float c = between(slope(4, 0, 0, 1), slope(5, 1, 0, 1), u);
    const float d = between(slope(6, 0, 1, 1), slope(7, 1, 1, 1), u);
    run.out[k] = kGain * between(between(a, b, v), between(c, d, v), w);
  }
}

}  // namespace

GradientNoise::Corners GradientNoise::corners_of(const std::array<std::int32_t, 3>& cell) const {
  Corners corners{};
  for (std::size_t corner = 0; corner < 8; ++corner) {
    std::uint32_t word = seed_;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto step = static_cast<std::uint32_t>((corner >> axis) & 1U);
      word = mixed(word ^ (static_cast<std::uint32_t>(cell[axis]) + step));
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      corners[axis][corner] = component(word, static_cast<unsigned>(10 * axis));
    }
  }
  return corners;
}

void GradientNoise::sample(const NoisePoints& points, std::span<float> out) {
  QMPIPE_CHECK(out.size() == points.size());
  for (std::size_t axis = 0; axis < 3; ++axis) {
    split_axis(points.axes[axis], frequency_, cells_[axis], parts_[axis]);
  }
  const std::int32_t* const i = cells_[0].data();
  const std::int32_t* const j = cells_[1].data();
  const std::int32_t* const k = cells_[2].data();
  std::size_t begin = 0;
  while (begin < out.size()) {
    std::size_t end = begin + 1;
    while (end < out.size() && i[end] == i[begin] && j[end] == j[begin] && k[end] == k[begin])
      ++end;
    sample_cell(corners_of({i[begin], j[begin], k[begin]}), {.x = parts_[0].data() + begin,
                                                             .y = parts_[1].data() + begin,
                                                             .z = parts_[2].data() + begin,
                                                             .out = out.data() + begin,
                                                             .size = end - begin});
    begin = end;
  }
}

}  // namespace qmpipe
