// Borders between the tile that decided them and the tile that inherits them.
//
// Thread rule: publish() and take() are safe from any thread.
#pragma once

#include <cstdint>
#include <memory>

#include "scheduler/border.h"
#include "scheduler/tile_key.h"

namespace qmpipe {

class BorderStore {
 public:
  virtual ~BorderStore() = default;
  // REQUIRES: the owner's border on that side was not published before.
  virtual void publish(const TileKey& owner, Side side, const BorderMask& mask) = 0;
  // Gives the border out and forgets it: each has one heir. REQUIRES: it was published.
  virtual BorderMask take(const TileKey& owner, Side side) = 0;
  // Borders that wait for their heirs.
  virtual std::int64_t size() const = 0;
};

std::unique_ptr<BorderStore> make_memory_border_store();

}  // namespace qmpipe
