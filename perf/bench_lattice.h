// One zoom of posts for the benchmarks of the lattice stores: put as the survey puts them, read as
// the mesh pass reads them (windows of 259 x 259 posts, tiles in the wavefront's order).
//
// A pass's time is the wall's, since writing waits for the disk; its CPU time comes as a counter,
// for machines that have other work too.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "formats/run_store/lattice_store.h"
#include "perf/bench_terrain.h"

namespace benchmark {
class State;
}

namespace qmpipe::perf {

inline constexpr std::int64_t kWideCacheBytes = std::int64_t{64} << 20U;

struct LatticeInputs {
  std::unique_ptr<BenchDem> dem;
  std::vector<std::vector<float>> blocks;  // of dem->tiles(), named like them
  // Half a row of blocks: what 64 MiB are to a DEM of some 110,000 columns.
  std::int64_t narrow_cache_bytes = 0;
};

// Makes inputs when they are first asked for, and keeps the last.
class LatticeInputsMaker {
 public:
  const LatticeInputs& get(DemKind kind);

 private:
  DemKind kind_ = DemKind::kInt16Deflate;
  std::unique_ptr<const LatticeInputs> inputs_;
};

// Throws IoError. The folder must be empty or hold a store of this kind.
std::unique_ptr<LatticeStore> open_disk_store(const std::filesystem::path& folder,
                                              std::int64_t cache_bytes);

// Puts every block and seals.
void put_all(LatticeStore& store, const LatticeInputs& inputs);

using FillWindow = std::function<void(const Lattice&, const PostWindow&, std::span<float>)>;
// Asks for every tile's window once, on as many threads as there are functions: each has its own.
void visit_windows(const LatticeInputs& inputs, std::span<const FillWindow> fills);
void read_all(const LatticeStore& store, const LatticeInputs& inputs, std::size_t threads);

struct PassTime {
  double wall_s = 0;
  double cpu_s = 0;
  PassTime& operator+=(const PassTime& other) {
    wall_s += other.wall_s;
    cpu_s += other.cpu_s;
    return *this;
  }
};

// From a store that is opened anew, with empty caches, the kernel's included.
PassTime read_cold(const std::filesystem::path& folder, const LatticeInputs& inputs,
                   std::int64_t cache_bytes, std::size_t threads);

// CPU time is that of all threads.
PassTime time_of(const std::function<void()>& work);

// Runs `pass` once an iteration; it returns the time that counts, which becomes the benchmark's.
// Adds the counters ns_per_post and cpu_ns_per_post.
void measure_passes(benchmark::State& state, const LatticeInputs& inputs,
                    const std::function<PassTime()>& pass);

// A benchmark of that kind. `maker` lives as long as it.
using RunPasses = std::function<void(benchmark::State&, const LatticeInputs&)>;
void register_passes(const std::string& name, const std::shared_ptr<LatticeInputsMaker>& maker,
                     DemKind kind, const RunPasses& run);

}  // namespace qmpipe::perf
