// How others number the rows of tiles: from the south, as we do and TMS does, or from the north, as
// web maps do (XYZ, "slippyMap").
#pragma once

#include <cstdint>

namespace qmpipe {

enum class RowOrder : std::uint8_t { kTms, kXyz };

}  // namespace qmpipe
