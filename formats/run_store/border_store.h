// Borders between the tile that decided them and the tile that inherits them.
//
// Guarantee: take() gives out the mask that was published last.
// Thread rule: all functions are safe from any thread, as long as no border is taken while it is
// published.
#pragma once

#include <cstdint>
#include <memory>

#include "scheduler/border.h"
#include "scheduler/tile_key.h"

namespace qmpipe {

class BorderStore {
 public:
  virtual ~BorderStore() = default;
  // REQUIRES: the owner's border on that side was not published to this object before. One that an
  // earlier run sealed may be published again (work that is done again after a kill).
  virtual void publish(const TileKey& owner, Side side, const BorderMask& mask) = 0;
  // Gives the border out and forgets it: each has one heir. REQUIRES: it was published, to this
  // object or in an earlier run that sealed it, and not taken from this object before.
  virtual BorderMask take(const TileKey& owner, Side side) = 0;
  // What was published before the call is safe on disk after it, taken or not, where the store is
  // on disk: then a later run may take it, again if need be.
  virtual void seal() = 0;
  // Borders that were published to this object and wait for their heirs.
  virtual std::int64_t size() const = 0;
  virtual std::int64_t memory_bytes() const = 0;
};

// Keeps everything in memory; seal() does nothing.
std::unique_ptr<BorderStore> make_memory_border_store();

}  // namespace qmpipe
