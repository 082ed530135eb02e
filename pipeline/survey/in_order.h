// A loop on the threads of an arena that keeps them at one place.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>

namespace qmpipe {

// Runs body(k) for 0 <= k < count on so many threads, which take one k after the other. An exception ends the loop
// and comes out.
void for_each_in_order(std::int32_t threads, std::size_t count,
                       const std::function<void(std::size_t)>& body);

}  // namespace qmpipe
