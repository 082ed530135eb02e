#include "pipeline/detail_model/verify.h"

#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <optional>
#include <random>
#include <span>
#include <utility>

#include "formats/bytes/hash64.h"
#include "stages/detail_model/block.h"
#include "stages/surface/triangle_edges.h"

namespace qmpipe {
namespace {

// One term for each triangle, so that the sum over all follows a change of a few.
std::uint64_t term_of(const DetailWalk& walk, std::size_t triangle) {
  const auto vertices = walk.triangles().subspan(3 * triangle, 3);
  return hash64({reinterpret_cast<const std::uint8_t*>(vertices.data()), vertices.size_bytes()},
                triangle);
}

std::uint64_t sum_of(const DetailWalk& walk) {
  std::uint64_t sum = 0;
  for (std::size_t t = 0; t < walk.triangles().size() / 3; ++t) sum += term_of(walk, t);
  return sum;
}

class BlockWalk {
 public:
  BlockWalk(const DetailBlock& block, Progress& progress) : block_(block), progress_(progress) {}

  std::int64_t triangles_checked() const { return triangles_checked_; }

  std::optional<std::string> find_fault() {
    if (auto fault = fault_of_thresholds()) return fault;
    auto walk = DetailWalk::start(block_);
    if (!walk) return walk.error().message;
    for (std::size_t t = 0; t < walk->triangles().size() / 3; ++t) {
      if (auto fault = fault_of_triangle(*walk, t)) return fault;
    }
    const auto rim = rim_of(walk->triangles());
    if (auto fault = walk_up(*walk)) return fault;
    if (rim_of(walk->triangles()) != rim) return "its rim differs between levels";
    return walk_down(*walk);
  }

 private:
  std::optional<std::string> fault_of_thresholds() const {
    if (block_.svo_m.size() != block_.levels() + 1) return "it has not a threshold for each level";
    for (std::size_t level = 0; level < block_.svo_m.size(); ++level) {
      const float svo_m = block_.svo_m[level];
      if (!std::isfinite(svo_m) || svo_m < 0) {
        return fmt::format("the threshold of level {} is {}", level, svo_m);
      }
      if (level > 0 && svo_m > block_.svo_m[level - 1]) {
        return fmt::format("the threshold rises from level {} to the finer {}", level - 1, level);
      }
    }
    return std::nullopt;
  }

  std::optional<std::string> fault_of_triangle(const DetailWalk& walk, std::size_t triangle) {
    ++triangles_checked_;
    const auto t = walk.triangles().subspan(3 * triangle, 3);
    if (plane_orientation(block_.points[t[0]], block_.points[t[1]], block_.points[t[2]]) > 0) {
      return std::nullopt;
    }
    return fmt::format("triangle {} of level {} is not counter-clockwise", triangle, walk.level());
  }

  std::optional<std::string> walk_up(DetailWalk& walk) {
    std::vector<std::uint32_t> changed;
    std::uint64_t sum = sum_of(walk);
    sums_.push_back(sum);
    while (walk.level() < block_.levels()) {
      changed.clear();
      auto error = walk.refine([&](std::uint32_t t) {
        sum -= term_of(walk, t);
        changed.push_back(t);
      });
      if (error) return error->message;
      const std::size_t triangles = walk.triangles().size() / 3;
      changed.push_back(static_cast<std::uint32_t>(triangles - 2));
      changed.push_back(static_cast<std::uint32_t>(triangles - 1));
      for (const std::uint32_t t : changed) {
        if (auto fault = fault_of_triangle(walk, t)) return fault;
        sum += term_of(walk, t);
      }
      sums_.push_back(sum);
      note_level(walk);
    }
    return std::nullopt;
  }

  void note_level(const DetailWalk& walk) {
    constexpr std::size_t kLevelsATime = 4096;
    if (walk.level() % kLevelsATime != 0) return;
    progress_.advance(kLevelsATime);
    progress_.check_stop();
  }

  std::optional<std::string> walk_down(DetailWalk& walk) {
    std::vector<std::uint32_t> changed;
    // Anew, not what the way up ended with.
    std::uint64_t sum = sum_of(walk);
    while (walk.level() > 0) {
      changed.clear();
      const std::size_t triangles = walk.triangles().size() / 3;
      sum -= term_of(walk, triangles - 2) + term_of(walk, triangles - 1);
      walk.coarsen([&](std::uint32_t t) {
        sum -= term_of(walk, t);
        changed.push_back(t);
      });
      for (const std::uint32_t t : changed) sum += term_of(walk, t);
      if (sums_[walk.level()] != sum) {
        return fmt::format("level {} is another mesh on the way back", walk.level());
      }
      note_level(walk);
    }
    // What was not told as changed stands as it was.
    if (sum_of(walk) != sums_.front()) return "the coarsest level is another mesh on the way back";
    return std::nullopt;
  }

  const DetailBlock& block_;
  Progress& progress_;
  std::vector<std::uint64_t> sums_;  // of each level
  std::int64_t triangles_checked_ = 0;
};

// The whole at one level of all blocks, with points numbered by place: blocks share none, but a point at
// which two fans touch is there for each of them.
class WholeCheck {
 public:
  explicit WholeCheck(const DetailModel& model) : model_(model) {}

  std::optional<std::string> find_fault(bool finest) {
    corners_.clear();
    for (const DetailBlock& block : model_.blocks) {
      auto walk = DetailWalk::start(block);
      if (!walk || (finest && walk->go_to(block.levels()))) return std::nullopt;  // told already
      for (const std::uint32_t vertex : walk->triangles()) corners_.push_back(block.points[vertex]);
    }
    const std::size_t first_seam = corners_.size() / 3;
    for (const DetailSeam& seam : model_.seams) {
      for (const DetailCorner& c : seam) corners_.push_back(model_.blocks[c.block].points[c.point]);
    }
    for (std::size_t t = first_seam; t < corners_.size() / 3; ++t) {
      if (plane_orientation(corners_[3 * t], corners_[3 * t + 1], corners_[3 * t + 2]) > 0)
        continue;
      return fmt::format("triangle {} of the seams is not counter-clockwise", t - first_seam);
    }
    if (auto fault = fault_of_edges()) return fault;
    return fault_of_cover();
  }

 private:
  static std::uint64_t place_of(const DetailPoint& p) {
    return static_cast<std::uint64_t>(static_cast<std::uint32_t>(p.x)) << 32U |
           static_cast<std::uint32_t>(p.y);
  }

  std::optional<std::string> fault_of_edges() const {
    std::vector<std::pair<std::uint64_t, std::uint64_t>> edges;
    edges.reserve(corners_.size());
    for (std::size_t e = 0; e < corners_.size(); ++e) {
      edges.emplace_back(place_of(corners_[e]), place_of(corners_[e % 3 == 2 ? e - 2 : e + 1]));
    }
    std::sort(edges.begin(), edges.end());
    const auto twice = std::adjacent_find(edges.begin(), edges.end());
    if (twice == edges.end()) return std::nullopt;
    return fmt::format("two triangles lie on the same side of the edge from {},{} to {},{}",
                       twice->first >> 32U, twice->first & 0xFFFFFFFFU, twice->second >> 32U,
                       twice->second & 0xFFFFFFFFU);
  }

  // Counts, for places at random in a grid of cells, the triangles that hold them strictly inside.
  std::optional<std::string> fault_of_cover() const {
    constexpr std::size_t kCells = 64;
    constexpr std::uint32_t kSeed = 1;
    if (corners_.empty()) return std::nullopt;
    const auto by_x = [](const DetailPoint& a, const DetailPoint& b) { return a.x < b.x; };
    const auto by_y = [](const DetailPoint& a, const DetailPoint& b) { return a.y < b.y; };
    const auto [west, east] = std::minmax_element(corners_.begin(), corners_.end(), by_x);
    const auto [south, north] = std::minmax_element(corners_.begin(), corners_.end(), by_y);
    const std::int64_t width = std::max(1, east->x - west->x);
    const std::int64_t height = std::max(1, north->y - south->y);
    std::mt19937 dice(kSeed);
    std::vector<DetailPoint> places(kCells * kCells);
    const auto roll = [&](std::size_t cell, std::int64_t extent) {
      const double share =
          (static_cast<double>(cell) + static_cast<double>(dice()) / 4294967296.0) / kCells;
      return static_cast<std::int32_t>(share * static_cast<double>(extent));
    };
    for (std::size_t k = 0; k < places.size(); ++k) {
      places[k] = {.x = west->x + roll(k % kCells, width),
                   .y = south->y + roll(k / kCells, height)};
    }
    const auto cell_of = [&](std::int64_t value, std::int64_t low, std::int64_t extent) {
      return static_cast<std::size_t>(std::min<std::int64_t>(
          (value - low) * static_cast<std::int64_t>(kCells) / extent, kCells - 1));
    };
    std::vector<int> cover(places.size(), 0);
    for (std::size_t t = 0; t < corners_.size(); t += 3) {
      const DetailPoint& a = corners_[t];
      const DetailPoint& b = corners_[t + 1];
      const DetailPoint& c = corners_[t + 2];
      const auto [x0, x1] = std::minmax({a.x, b.x, c.x});
      const auto [y0, y1] = std::minmax({a.y, b.y, c.y});
      for (std::size_t j = cell_of(y0, south->y, height); j <= cell_of(y1, south->y, height); ++j) {
        for (std::size_t i = cell_of(x0, west->x, width); i <= cell_of(x1, west->x, width); ++i) {
          const DetailPoint& p = places[j * kCells + i];
          if (plane_orientation(a, b, p) <= 0 || plane_orientation(b, c, p) <= 0 ||
              plane_orientation(c, a, p) <= 0) {
            continue;
          }
          if (++cover[j * kCells + i] > 1) {
            return fmt::format("two triangles overlap at {},{} of the grid", p.x, p.y);
          }
        }
      }
    }
    return std::nullopt;
  }

  const DetailModel& model_;
  std::vector<DetailPoint> corners_;  // three for each triangle
};

}  // namespace

DetailVerifyReport verify_detail(const DetailModel& model, std::int32_t threads,
                                 Progress& progress) {
  DetailVerifyReport report;
  std::int64_t levels = 0;
  for (const DetailBlock& block : model.blocks) levels += static_cast<std::int64_t>(block.levels());
  std::vector<std::optional<std::string>> faults(model.blocks.size());
  std::atomic<std::int64_t> triangles = 0;
  tbb::task_arena arena(threads);
  arena.execute([&] {
    const Phase phase(progress, "verify", "levels", 2 * levels);
    tbb::parallel_for(std::size_t{0}, model.blocks.size(), [&](std::size_t b) {
      BlockWalk walk(model.blocks[b], progress);
      faults[b] = walk.find_fault();
      triangles += walk.triangles_checked();
    });
  });
  report.levels_walked = 2 * levels;
  report.triangles_checked = triangles;
  for (std::size_t b = 0; b < faults.size(); ++b) {
    if (faults[b]) report.faults.push_back(fmt::format("block {}: {}", b, *faults[b]));
  }
  if (!report.faults.empty()) return report;
  WholeCheck whole(model);
  for (const bool finest : {false, true}) {
    const auto fault = whole.find_fault(finest);
    if (!fault) continue;
    report.faults.push_back(
        fmt::format("at the {} level: {}", finest ? "finest" : "coarsest", *fault));
  }
  return report;
}

}  // namespace qmpipe
