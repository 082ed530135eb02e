// A lattice store made of two: coarse zooms in one (memory), deep ones in another (disk).
//
// As safe from several threads as its parts are.
#pragma once

#include <cstdint>
#include <memory>

#include "formats/run_store/lattice_store.h"

namespace qmpipe {

// Zooms 0 .. last_coarse_zoom go to `coarse`, deeper ones to `deep`; -1 sends all to `deep`.
// REQUIRES: both have the same scheme, and room for the zooms they get.
std::unique_ptr<LatticeStore> make_tiered_lattice_store(std::unique_ptr<LatticeStore> coarse,
                                                        std::int32_t last_coarse_zoom,
                                                        std::unique_ptr<LatticeStore> deep);

}  // namespace qmpipe
