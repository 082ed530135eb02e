// Checks for our own mistakes. A failed check is a bug in qmpipe, never a fault of the input:
// it throws InternalError, which ends the run with its place and its condition.
//
// QMPIPE_CHECK   always compiled in: for cheap conditions and at every stage's entry and exit.
// QMPIPE_ASSERT  compiled in unless NDEBUG is set: for conditions inside loops.
#pragma once

#include <stdexcept>
#include <string>

namespace qmpipe {

class InternalError : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

namespace detail {
[[noreturn]] inline void check_failed(const char* condition, const char* file, int line) {
  throw InternalError(std::string("internal error: ") + condition + " does not hold at " + file +
                      ":" + std::to_string(line) + "; please report this as a bug");
}
}  // namespace detail

}  // namespace qmpipe

#define QMPIPE_CHECK(condition) \
  ((condition) ? void(0) : ::qmpipe::detail::check_failed(#condition, __FILE__, __LINE__))

#ifdef NDEBUG
#define QMPIPE_ASSERT(condition) ((void)0)
#else
#define QMPIPE_ASSERT(condition) QMPIPE_CHECK(condition)
#endif
