#include "pipeline/convert/diff_sets.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include "pipeline/run/ordered_work.h"

namespace qmpipe {
namespace {

using Bytes = std::vector<std::uint8_t>;

struct SharedKey {
  TileKey key;
  bool is_in_a = false;
  bool is_in_b = false;
};

// Of both sets, by key.
std::vector<SharedKey> joined(const std::vector<TileKey>& a, const std::vector<TileKey>& b) {
  std::vector<SharedKey> keys;
  keys.reserve(std::max(a.size(), b.size()));
  auto in_a = a.begin();
  auto in_b = b.begin();
  while (in_a != a.end() || in_b != b.end()) {
    const bool takes_a = in_b == b.end() || (in_a != a.end() && *in_a <= *in_b);
    const bool takes_b = in_a == a.end() || (in_b != b.end() && *in_b <= *in_a);
    keys.push_back({.key = takes_a ? *in_a : *in_b, .is_in_a = takes_a, .is_in_b = takes_b});
    if (takes_a) ++in_a;
    if (takes_b) ++in_b;
  }
  return keys;
}

enum class Verdict { kOnlyInA, kOnlyInB, kSameBytes, kSameUnpacked, kDifferent };

struct TileComparison {
  Verdict verdict = Verdict::kSameBytes;
  TileDifference difference = {};  // of kDifferent
};

// A tile as far as it can be had.
struct ReadTile {
  std::string fault;
  Bytes plain;
  std::optional<QuantizedMesh> mesh;
};

ReadTile read_tile(Result<Bytes> stored) {
  ReadTile tile;
  auto plain = stored ? plain_tile_bytes(std::move(*stored)) : std::move(stored);
  if (!plain) {
    tile.fault = plain.error().message;
    return tile;
  }
  tile.plain = std::move(*plain);
  auto mesh = decode(tile.plain);
  if (mesh) {
    tile.mesh = std::move(*mesh);
  } else {
    tile.fault = mesh.error().message;
  }
  return tile;
}

TileComparison different(const TileKey& key, const ReadTile& a, const ReadTile& b) {
  TileComparison comparison = {.verdict = Verdict::kDifferent, .difference = {.key = key}};
  TileDifference& difference = comparison.difference;
  for (const auto& [name, fault] : {std::pair("A", &a.fault), std::pair("B", &b.fault)}) {
    if (fault->empty()) continue;
    difference.is_undecodable = true;
    difference.parts.push_back(fmt::format("{} cannot be decoded: {}", name, *fault));
  }
  if (difference.is_undecodable) return comparison;
  difference.mesh = difference_of(*a.mesh, *b.mesh);
  difference.parts = std::exchange(difference.mesh.parts, {});
  if (difference.parts.empty()) {
    difference.parts.emplace_back("bytes that are passed over: extensions that are not known");
  }
  return comparison;
}

TileComparison compare_tiles(const TileKey& key, const TileSet& a, const TileSet& b) {
  auto stored_a = a.read(key);
  auto stored_b = b.read(key);
  if (stored_a && stored_b && *stored_a == *stored_b) return {.verdict = Verdict::kSameBytes};
  const ReadTile tile_a = read_tile(std::move(stored_a));
  const ReadTile tile_b = read_tile(std::move(stored_b));
  // Also of tiles that are none, as long as they could be unpacked.
  if (!tile_a.plain.empty() && tile_a.plain == tile_b.plain) {
    return {.verdict = Verdict::kSameUnpacked};
  }
  return different(key, tile_a, tile_b);
}

bool is_worse(const TileDifference& a, const TileDifference& b) {
  const auto rank = [](const TileDifference& d) {
    return std::tuple(!d.is_undecodable, -d.mesh.largest_height_m,
                      -(d.mesh.posts_only_in_a + d.mesh.posts_only_in_b), d.key);
  };
  return rank(a) < rank(b);
}

class Collector {
 public:
  explicit Collector(std::int64_t most_listed)
      : most_listed_(static_cast<std::size_t>(most_listed)) {}

  // REQUIRES: by key.
  void add(const SharedKey& shared, TileComparison comparison) {
    const TileKey& key = shared.key;
    if (report_.zooms.empty() || report_.zooms.back().zoom != key.zoom) {
      report_.zooms.push_back({.zoom = key.zoom});
    }
    for (ZoomDiff* const counts : {&report_.zooms.back(), &report_.total}) {
      if (shared.is_in_a) ++counts->tiles_a;
      if (shared.is_in_b) ++counts->tiles_b;
      count(comparison, *counts);
    }
    if (comparison.verdict == Verdict::kOnlyInA) list(key, report_.only_in_a);
    if (comparison.verdict == Verdict::kOnlyInB) list(key, report_.only_in_b);
    if (comparison.verdict == Verdict::kDifferent) keep_worst(std::move(comparison.difference));
  }

  DiffReport take() {
    report_.worst.assign(worst_.begin(), worst_.end());
    return std::move(report_);
  }

 private:
  static void count(const TileComparison& comparison, ZoomDiff& counts) {
    switch (comparison.verdict) {
      case Verdict::kOnlyInA:
        ++counts.only_in_a;
        break;
      case Verdict::kOnlyInB:
        ++counts.only_in_b;
        break;
      case Verdict::kSameBytes:
        ++counts.same_bytes;
        break;
      case Verdict::kSameUnpacked:
        ++counts.same_unpacked;
        break;
      case Verdict::kDifferent:
        ++counts.different;
        if (comparison.difference.is_undecodable) ++counts.undecodable;
        counts.largest_height_m =
            std::max(counts.largest_height_m, comparison.difference.mesh.largest_height_m);
        break;
    }
  }

  void list(const TileKey& key, std::vector<TileKey>& keys) const {
    if (keys.size() < most_listed_) keys.push_back(key);
  }

  void keep_worst(TileDifference difference) {
    worst_.insert(std::move(difference));
    if (worst_.size() > most_listed_) worst_.erase(std::prev(worst_.end()));
  }

  const std::size_t most_listed_;
  DiffReport report_;
  std::set<TileDifference, decltype(&is_worse)> worst_{&is_worse};
};

}  // namespace

bool DiffReport::is_same() const {
  return layer.empty() && total.only_in_a == 0 && total.only_in_b == 0 && total.different == 0;
}

DiffReport diff_sets(const TileSet& a, const TileSet& b, const DiffOptions& options,
                     Progress& progress) {
  const std::vector<SharedKey> keys = joined(a.keys(), b.keys());
  const auto count = static_cast<std::int64_t>(keys.size());
  Collector collector(options.most_listed);
  const Phase phase(progress, "diff", "tiles", count);
  const auto work = [&](std::int64_t index) -> InTurn {
    const SharedKey& shared = keys[static_cast<std::size_t>(index)];
    TileComparison comparison;
    if (shared.is_in_a && shared.is_in_b) {
      comparison = compare_tiles(shared.key, a, b);
    } else {
      comparison.verdict = shared.is_in_a ? Verdict::kOnlyInA : Verdict::kOnlyInB;
    }
    return [&collector, &progress, &shared, comparison = std::move(comparison)] {
      collector.add(shared, comparison);
      progress.advance(1);
      return true;
    };
  };
  const std::int64_t done =
      work_in_order(options.threads, count, work, [&] { return progress.should_stop(); });
  if (done < count) {
    throw Interrupted(fmt::format("stopped after comparing {} of {} tiles", done, count));
  }
  DiffReport report = collector.take();
  report.layer = differences_of_layers(a.layer_text(), b.layer_text());
  return report;
}

}  // namespace qmpipe
