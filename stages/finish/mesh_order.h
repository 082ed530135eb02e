// The order of a tile's triangles and vertices, which decides its size: the index codes and the
// deltas of u, v, h are small only where neighbours in the file are neighbours on the ground.
#pragma once

#include "stages/surface/tin.h"

namespace qmpipe {

// The same TIN with its triangles along strips and its vertices numbered by first use, as the
// high-water-mark code of the format wants them. Deterministic.
Tin strip_ordered(const Tin& tin);

}  // namespace qmpipe
