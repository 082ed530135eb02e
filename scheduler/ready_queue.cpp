#include "scheduler/ready_queue.h"

#include <algorithm>

#include "scheduler/check.h"

namespace qmpipe {
ReadyQueue::ReadyQueue(const WavefrontPlan& plan, std::int32_t max_in_flight, TileIndex first)
    : plan_(plan), max_in_flight_(max_in_flight), next_to_retire_(first) {
  QMPIPE_CHECK(max_in_flight >= 1);
  QMPIPE_CHECK(first >= 0 && static_cast<std::size_t>(first) <= plan.tiles.size());
  in_degree_.reserve(plan.tiles.size());
  for (const PlannedTile& tile : plan.tiles) {
    const auto k = static_cast<TileIndex>(in_degree_.size());
    in_degree_.push_back(tile.in_degree);
    if (tile.in_degree == 0 && k >= first) ready_.push(k);
  }
  for (TileIndex done = 0; done < first; ++done) release_heirs(done);
}

void ReadyQueue::release_heirs(TileIndex tile) {
  const PlannedTile& planned = plan_.tiles.at(static_cast<std::size_t>(tile));
  for (const Side side : kSides) {
    if (planned.roles[index_of(side)] != SideRole::kOwner) continue;
    const TileIndex heir = planned.neighbours[index_of(side)];
    std::int32_t& waits_for = in_degree_[static_cast<std::size_t>(heir)];
    QMPIPE_CHECK(waits_for > 0);
    // An earlier heir was done by an earlier run.
    if (--waits_for == 0 && heir >= next_to_retire_) ready_.push(heir);
  }
}

std::optional<TileIndex> ReadyQueue::pop() {
  const std::scoped_lock lock(mutex_);
  if (ready_.empty() || ready_.top() - next_to_retire_ >= max_in_flight_) return std::nullopt;
  const TileIndex tile = ready_.top();
  ready_.pop();
  largest_in_flight_ = std::max(largest_in_flight_, ++in_flight_);
  return tile;
}

void ReadyQueue::publish(TileIndex tile) {
  const std::scoped_lock lock(mutex_);
  release_heirs(tile);
}

void ReadyQueue::retire(TileIndex tile) {
  const std::scoped_lock lock(mutex_);
  QMPIPE_CHECK(tile == next_to_retire_);
  ++next_to_retire_;
  --in_flight_;
}

bool ReadyQueue::all_retired() const {
  const std::scoped_lock lock(mutex_);
  return next_to_retire_ == static_cast<TileIndex>(plan_.tiles.size());
}

std::int32_t ReadyQueue::in_flight() const {
  const std::scoped_lock lock(mutex_);
  return in_flight_;
}

std::int32_t ReadyQueue::waiting_for_room() const {
  const std::scoped_lock lock(mutex_);
  return static_cast<std::int32_t>(ready_.size());
}

std::int32_t ReadyQueue::largest_in_flight() const {
  const std::scoped_lock lock(mutex_);
  return largest_in_flight_;
}

}  // namespace qmpipe
