// How many tiles a second do the sinks take, and the sets give back?
//
// Tiles of 1 to 40 kB (small ones more often) that cannot be packed further, an eighth of them equal
// to an earlier one, in a build's order by rows. `write` syncs every 2000 tiles, as a checkpoint
// does every 10 s at 200 tiles a second, and closes the set; `read` reads all of a set, in the order
// of its keys, from the system's cache.
#include <benchmark/benchmark.h>

#include <chrono>
#include <cmath>
#include <functional>
#include <random>
#include <thread>

#include "formats/tile_sets/open_tile_set.h"
#include "formats/tile_sets/tile_output.h"
#include "perf/bench_terrain.h"
#include "perf/register_benchmarks.h"

namespace qmpipe::perf {
namespace {

namespace fs = std::filesystem;

constexpr std::int32_t kColumns = 200;
constexpr std::int32_t kTilesPerSync = 2000;

struct Tiles {
  std::vector<std::uint8_t> noise;
  struct Place {
    TileKey key;
    std::size_t start = 0;
    std::size_t bytes = 0;
  };
  std::vector<Place> places;
  std::int64_t bytes = 0;

  std::span<const std::uint8_t> bytes_of(const Place& place) const {
    return std::span(noise).subspan(place.start, place.bytes);
  }
};

Tiles make_tiles() {
  constexpr double kLeastBytes = 1000;
  constexpr double kMostBytes = 40000;
  std::mt19937_64 random(1);
  Tiles tiles;
  tiles.noise.resize(std::size_t{4} << 20U);
  for (std::uint8_t& byte : tiles.noise) byte = static_cast<std::uint8_t>(random());
  const std::int32_t count = is_small_run() ? 400 : 20000;
  for (std::int32_t k = 0; k < count; ++k) {
    Tiles::Place place;
    if (k > 0 && random() % 8 == 0) {
      place = tiles.places[random() % tiles.places.size()];
    } else {
      const double share = static_cast<double>(random() % 1000000) / 1e6;
      place.bytes =
          static_cast<std::size_t>(kLeastBytes * std::pow(kMostBytes / kLeastBytes, share));
      place.start = random() % (tiles.noise.size() - place.bytes);
    }
    place.key = {.zoom = 12, .x = 4000 + k % kColumns, .y = 2000 + k / kColumns};
    tiles.bytes += static_cast<std::int64_t>(place.bytes);
    tiles.places.push_back(place);
  }
  return tiles;
}

void write_all(const Tiles& tiles, const fs::path& output) {
  const auto sink = open_tile_sink(output, Overwrite::kNo);
  std::int32_t written = 0;
  for (const Tiles::Place& place : tiles.places) {
    sink->write(place.key, tiles.bytes_of(place));
    if (++written % kTilesPerSync == 0) sink->sync();
  }
  sink->close("{}");
}

std::int64_t bytes_in(const fs::path& folder) {
  std::int64_t bytes = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) bytes += static_cast<std::int64_t>(entry.file_size());
  }
  return bytes;
}

double seconds_of(const std::function<void()>& work) {
  const auto started = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - started).count();
}

void write(benchmark::State& state, const Tiles& tiles, const char* name) {
  double bytes_on_disk = 0;
  for (auto _ : state) {
    const testing::TemporaryFolder folder;
    state.SetIterationTime(seconds_of([&] { write_all(tiles, folder.path() / name); }));
    bytes_on_disk = static_cast<double>(bytes_in(folder.path()));
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(tiles.places.size()));
  state.counters["file_bytes_per_tile_byte"] = bytes_on_disk / static_cast<double>(tiles.bytes);
}

void read(benchmark::State& state, const Tiles& tiles, const char* name, std::size_t threads) {
  const testing::TemporaryFolder folder;
  write_all(tiles, folder.path() / name);
  const auto set = open_tile_set(folder.path() / name);
  const auto read_share = [&](std::size_t first) {
    for (std::size_t k = first; k < set->keys().size(); k += threads) {
      benchmark::DoNotOptimize(set->read(set->keys()[k]));
    }
  };
  for (auto _ : state) {
    std::vector<std::jthread> readers;
    for (std::size_t t = 0; t < threads; ++t) readers.emplace_back(read_share, t);
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(set->keys().size()));
}

}  // namespace

void register_benchmarks() {
  const auto tiles = std::make_shared<const Tiles>(make_tiles());
  for (const char* name : {"folder", "file.mbtiles"}) {
    const std::string form = name == std::string("folder") ? "folder" : "mbtiles";
    benchmark::RegisterBenchmark(
        ("sink/" + form + "/write").c_str(),
        [tiles, name](benchmark::State& state) { write(state, *tiles, name); })
        ->UseManualTime()
        ->Unit(benchmark::kMillisecond);
    for (const std::size_t threads : {1U, 2U}) {
      benchmark::RegisterBenchmark(
          ("set/" + form + "/read/" + std::to_string(threads)).c_str(),
          [tiles, name, threads](benchmark::State& state) { read(state, *tiles, name, threads); })
          ->UseRealTime()
          ->Unit(benchmark::kMillisecond);
    }
  }
}

}  // namespace qmpipe::perf
