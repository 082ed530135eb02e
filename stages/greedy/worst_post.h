// The inner loop of greedy insertion: the largest distance between posts and planes, four posts at
// a time. It decides the speed of a run (about twenty visits to each post), so it is written with
// the compiler's vector types, which every machine has (SSE2, NEON, or plain code).
//
// Guarantees: among posts of equal error the one with the lowest index wins; the result does not
// depend on the vector unit, since each lane does the same float operations as scalar code would.
#pragma once

#include <cstdint>
#include <cstring>

namespace qmpipe {

struct Worst {
  float error = 0;
  std::int32_t post = -1;
};

// A straight line over a row of posts: the value at the row's k-th post is start + step * k.
struct RowLine {
  float start = 0;
  float step = 0;
};

class WorstPost {
 public:
  // How many floats beyond a row's last post may be read (never used): pad the arrays by it.
  static constexpr std::int32_t kOverread = 3;

  // Looks at n posts from index `first`; `values` points at the first one's value.
  void look(const float* values, RowLine line, std::int32_t first, std::int32_t n) {
    scan<false>(values, line, nullptr, {}, first, n);
  }
  // The error of a post is the larger one of two.
  void look(const float* values, RowLine line, const float* others, RowLine other_line,
            std::int32_t first, std::int32_t n) {
    scan<true>(values, line, others, other_line, first, n);
  }

  Worst result() const {
    Worst worst;
    for (int lane = 0; lane < 4; ++lane) {
      const bool larger = error_[lane] > worst.error;
      const bool equal = error_[lane] == worst.error && post_[lane] < worst.post;
      if (larger || equal) worst = {error_[lane], post_[lane]};
    }
    return worst;
  }

 private:
  using Floats = float __attribute__((vector_size(16)));
  using Ints = std::int32_t __attribute__((vector_size(16)));

  static Floats load(const float* from) {
    Floats v;
    std::memcpy(&v, from, sizeof v);
    return v;
  }
  static Floats magnitude(Floats v) {
    return reinterpret_cast<Floats>(reinterpret_cast<Ints>(v) & 0x7FFFFFFF);
  }

  template <bool kTwo>
  void scan(const float* values, RowLine line, const float* others, RowLine other_line,
            std::int32_t first, std::int32_t n) {
    Floats place = {0, 1, 2, 3};
    Ints left = Ints{0, -1, -2, -3} + n;  // posts left, counted from each lane
    Ints post = Ints{0, 1, 2, 3} + first;
    for (std::int32_t k = 0; k < n; k += 4) {
      Floats error = magnitude(line.start + line.step * place - load(values + k));
      if constexpr (kTwo) {
        const Floats other =
            magnitude(other_line.start + other_line.step * place - load(others + k));
        error = error > other ? error : other;
      }
      const Ints better = (error > error_) & (left > 0);
      error_ = better ? error : error_;
      post_ = better ? post : post_;
      place += 4.0F;
      left -= 4;
      post += 4;
    }
  }

  Floats error_ = {0, 0, 0, 0};
  Ints post_ = {-1, -1, -1, -1};
};

}  // namespace qmpipe
