#include "scheduler/ready_queue.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <limits>
#include <mutex>
#include <random>
#include <set>
#include <thread>

#include "scheduler/check.h"

namespace qmpipe::ready_queue_test {
namespace {

const TilingScheme kGeodetic(Projection::kGeodetic);
const TilingScheme kMercator(Projection::kMercator);

WavefrontPlan plan_of(const TilingScheme& scheme, std::int32_t zoom, std::uint64_t bits) {
  std::vector<TileKey> keys;
  for (std::int32_t y = 0; y < scheme.rows(zoom); ++y) {
    for (std::int32_t x = 0; x < scheme.columns(zoom); ++x) {
      if ((bits & 1U) != 0) keys.push_back({zoom, x, y});
      bits = bits >> 1U | (bits & 1U) << 63U;
    }
  }
  return plan_wavefront(scheme, keys);
}

// The queue and what is known about it from outside: each step checks what it sees.
class Run {
 public:
  enum class State : std::uint8_t { kWaiting, kInFlight, kPublished, kRetired };

  Run(const WavefrontPlan& plan, std::int32_t window, std::size_t first = 0)
      : plan_(plan),
        window_(window),
        queue_(plan, window, static_cast<TileIndex>(first)),
        states_(plan.tiles.size()),
        retired_(first) {
    std::fill_n(states_.begin(), first, State::kRetired);
  }

  // False when there is nothing to hand out; `fault` says what was handed out wrongly.
  bool pop() {
    const auto tile = queue_.pop();
    if (!tile) return false;
    State& state = states_.at(static_cast<std::size_t>(*tile));
    if (state != State::kWaiting) fault = "a tile was handed out twice";
    state = State::kInFlight;
    ++in_flight_;
    const PlannedTile& planned = plan_.tiles[static_cast<std::size_t>(*tile)];
    for (const Side side : kSides) {
      if (planned.roles[index_of(side)] != SideRole::kHeir) continue;
      const State owner = states_.at(static_cast<std::size_t>(planned.neighbours[index_of(side)]));
      if (owner < State::kPublished) fault = "handed out before its owner published";
    }
    if (in_flight_ > window_ || queue_.in_flight() != in_flight_) fault = "more than the window";
    return true;
  }
  bool can_publish(std::size_t k) const { return states_[k] == State::kInFlight; }
  void publish(std::size_t k) {
    queue_.publish(static_cast<TileIndex>(k));
    states_[k] = State::kPublished;
  }
  bool can_retire() const {
    return retired_ < states_.size() && states_[retired_] == State::kPublished;
  }
  void retire() {
    queue_.retire(static_cast<TileIndex>(retired_));
    states_[retired_++] = State::kRetired;
    --in_flight_;
  }
  bool done() const {
    return retired_ == states_.size() && queue_.all_retired() && queue_.in_flight() == 0;
  }
  const std::vector<State>& states() const { return states_; }
  std::string fault;

 private:
  const WavefrontPlan& plan_;
  std::int32_t window_;
  ReadyQueue queue_;
  std::vector<State> states_;
  std::size_t retired_ = 0;
  std::int32_t in_flight_ = 0;
};

// An event: -2 pop, -1 retire, k >= 0 publish tile k.
bool apply(Run& run, int event) {
  if (event == -2) return run.pop();
  if (event == -1) {
    if (!run.can_retire()) return false;
    run.retire();
    return true;
  }
  if (!run.can_publish(static_cast<std::size_t>(event))) return false;
  run.publish(static_cast<std::size_t>(event));
  return true;
}

// Visits every state that any order of events can reach; each by replaying its events.
class Explorer {
 public:
  Explorer(const WavefrontPlan& plan, std::int32_t window, std::size_t first = 0)
      : plan_(plan), window_(window), first_(first) {}

  std::string explore(std::vector<int>& events) {
    bool progressed = false;
    Run here(plan_, window_, first_);
    for (const int event : events) apply(here, event);
    if (here.done()) return "";
    for (int event = -2; event < static_cast<int>(plan_.tiles.size()); ++event) {
      Run run(plan_, window_, first_);
      for (const int past : events) apply(run, past);
      if (!apply(run, event)) continue;
      progressed = true;
      if (!run.fault.empty()) return run.fault;
      if (!seen_.insert(run.states()).second) continue;
      events.push_back(event);
      const std::string fault = explore(events);
      events.pop_back();
      if (!fault.empty()) return fault;
    }
    return progressed ? "" : "deadlock after " + std::to_string(events.size()) + " events";
  }

 private:
  const WavefrontPlan& plan_;
  std::int32_t window_;
  std::size_t first_;
  std::set<std::vector<Run::State>> seen_;
};

TEST(ReadyQueue, EveryOrderOfEventsCompletesForEverySmallPlanAndWindow) {
  for (std::uint64_t bits = 1; bits < 256; ++bits) {
    const WavefrontPlan plan = plan_of(kGeodetic, 1, bits);
    for (std::int32_t window = 1; window <= 8; ++window) {
      if (window > static_cast<std::int32_t>(plan.tiles.size()) + 1) continue;
      // All subsets with few tiles; of the large ones, all windows for the full zoom.
      if (plan.tiles.size() > 6 && bits != 255) continue;
      std::vector<int> events;
      ASSERT_EQ(Explorer(plan, window).explore(events), "") << bits << " window " << window;
    }
  }
}

TEST(ReadyQueue, EveryOrderOfEventsCompletesInTheMercatorScheme) {
  for (std::uint64_t bits = 1; bits < 16; ++bits) {
    for (std::int32_t window = 1; window <= 8; ++window) {
      const WavefrontPlan plan = plan_of(kMercator, 1, bits);
      std::vector<int> events;
      ASSERT_EQ(Explorer(plan, window).explore(events), "") << bits << " window " << window;
    }
  }
  const WavefrontPlan root = plan_of(kMercator, 0, 1);
  std::vector<int> events;
  EXPECT_EQ(Explorer(root, 1).explore(events), "");
}

TEST(ReadyQueue, EveryOrderOfEventsCompletesFromAnyTileOn) {
  for (const std::uint64_t bits : {255U, 0x7EU, 0xB7U}) {
    const WavefrontPlan plan = plan_of(kGeodetic, 1, bits);
    for (std::size_t first = 1; first <= plan.tiles.size(); ++first) {
      for (const std::int32_t window : {1, 3, 8}) {
        std::vector<int> events;
        ASSERT_EQ(Explorer(plan, window, first).explore(events), "") << bits << " from " << first;
      }
    }
  }
  const WavefrontPlan plan = plan_of(kGeodetic, 1, 255);
  EXPECT_TRUE(ReadyQueue(plan, 1, 8).all_retired());
  EXPECT_THROW(ReadyQueue(plan, 1, 9), InternalError);
}

void run_at_random(const WavefrontPlan& plan, std::int32_t window, std::mt19937_64& random) {
  Run run(plan, window);
  std::vector<std::size_t> working;
  std::vector<std::uint8_t> known(plan.tiles.size(), 0);
  for (std::size_t idle = 0; !run.done(); ++idle) {
    ASSERT_LT(idle, 1000U) << "deadlock";
    const std::uint64_t event = random() % 3;
    if (event == 0 && run.pop()) {
      idle = 0;
      for (std::size_t k = 0; k < plan.tiles.size(); ++k) {
        if (run.can_publish(k) && known[k] == 0) working.push_back(k);
        if (run.can_publish(k)) known[k] = 1;
      }
    } else if (event == 1 && !working.empty()) {
      const std::size_t pick = random() % working.size();
      run.publish(working[pick]);
      working.erase(working.begin() + static_cast<std::ptrdiff_t>(pick));
      idle = 0;
    } else if (event == 2 && run.can_retire()) {
      run.retire();
      idle = 0;
    }
    ASSERT_EQ(run.fault, "");
  }
}

TEST(ReadyQueue, RandomTimingCompletesForEveryWindow) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const TilingScheme& scheme = seed % 2 == 0 ? kGeodetic : kMercator;
    const WavefrontPlan plan =
        plan_of(scheme, 2 + static_cast<std::int32_t>(seed % 3), random() | random());
    for (std::int32_t window = 1; window <= 8; ++window) run_at_random(plan, window, random);
    run_at_random(plan, 100, random);
  }
}

TEST(ReadyQueue, AnyWindowIsAllowed) {
  const WavefrontPlan plan = plan_of(kGeodetic, 1, 255);
  std::mt19937_64 random(1);
  run_at_random(plan, std::numeric_limits<std::int32_t>::max(), random);
  ReadyQueue queue(plan, std::numeric_limits<std::int32_t>::max());
  ASSERT_TRUE(queue.pop());
  queue.publish(0);
  queue.retire(0);
  EXPECT_TRUE(queue.pop()) << "the end of the window must not overflow";
  EXPECT_THROW(ReadyQueue(plan, 0), InternalError);
}

TEST(ReadyQueue, RetiringOutOfOrderIsABug) {
  const WavefrontPlan plan = plan_of(kGeodetic, 1, 255);
  ReadyQueue queue(plan, 8);
  ASSERT_EQ(queue.pop(), 0);
  ASSERT_TRUE(queue.pop());
  EXPECT_THROW(queue.retire(1), InternalError);
}

TEST(ReadyQueue, AnEmptyPlanIsDoneAtOnce) {
  const WavefrontPlan plan;
  ReadyQueue queue(plan, 1);
  EXPECT_TRUE(queue.all_retired());
  EXPECT_FALSE(queue.pop());
}

// A run in miniature: workers pop and publish, whoever comes by retires what is due.
class Crew {
 public:
  Crew(const WavefrontPlan& plan, std::int32_t window)
      : plan_(plan),
        queue_(plan, window),
        published_(plan.tiles.size()),
        times_(plan.tiles.size()) {}

  void work(std::uint64_t seed) {
    std::mt19937_64 random(seed);
    while (!queue_.all_retired()) {
      const auto tile = queue_.pop();
      if (!tile) {
        std::unique_lock lock(mutex_);
        changed_.wait_for(lock, std::chrono::milliseconds(1));
        continue;
      }
      build(static_cast<std::size_t>(*tile));
      for (std::uint64_t spin = random() % 300; spin > 0; --spin)
        std::atomic_signal_fence(std::memory_order_seq_cst);
      queue_.publish(*tile);
      retire_what_is_due(static_cast<std::size_t>(*tile));
      changed_.notify_all();
    }
  }
  std::vector<int> times() const { return {times_.begin(), times_.end()}; }
  int early() const { return early_; }
  std::int32_t largest_in_flight() const { return queue_.largest_in_flight(); }

 private:
  // Reads what its owners wrote without any lock of its own: the queue's is the only order there is,
  // so the thread sanitizer sees whether it is enough.
  void build(std::size_t tile) {
    ++times_[tile];
    int sum = 1;
    for (const Side side : kSides) {
      if (plan_.tiles[tile].roles[index_of(side)] != SideRole::kHeir) continue;
      const int border =
          published_[static_cast<std::size_t>(plan_.tiles[tile].neighbours[index_of(side)])];
      if (border == 0) ++early_;
      sum += border;
    }
    published_[tile] = sum;
  }
  void retire_what_is_due(std::size_t tile) {
    const std::scoped_lock lock(mutex_);
    finished_.insert(tile);
    while (!finished_.empty() && *finished_.begin() == next_) {
      finished_.erase(finished_.begin());
      queue_.retire(static_cast<TileIndex>(next_++));
    }
  }

  const WavefrontPlan& plan_;
  ReadyQueue queue_;
  std::vector<int> published_;
  std::vector<int> times_;
  std::atomic<int> early_ = 0;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::set<std::size_t> finished_;
  std::size_t next_ = 0;
};

TEST(ReadyQueue, ManyThreadsBuildEveryTileOnceAndInOrder) {
  const WavefrontPlan plan = plan_of(kGeodetic, 4, ~0ULL);
  for (const std::int32_t window : {1, 2, 7, 64}) {
    for (const std::uint64_t workers : {2U, 8U}) {
      SCOPED_TRACE("window " + std::to_string(window) + ", threads " + std::to_string(workers));
      Crew crew(plan, window);
      std::vector<std::thread> threads;
      for (std::uint64_t k = 0; k < workers; ++k) {
        threads.emplace_back([&crew, k] { crew.work(k + 1); });
      }
      for (std::thread& thread : threads) thread.join();
      EXPECT_EQ(crew.times(), std::vector<int>(plan.tiles.size(), 1));
      EXPECT_EQ(crew.early(), 0);
      EXPECT_LE(crew.largest_in_flight(), window);
    }
  }
}

}  // namespace
}  // namespace qmpipe::ready_queue_test
