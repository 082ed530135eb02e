// What stands for the height of a post or a pixel that has none.
#pragma once

#include <limits>

namespace qmpipe {

// As a double it is NaN too.
inline constexpr float kVoidHeight = std::numeric_limits<float>::quiet_NaN();

}  // namespace qmpipe
