// A deleter that is a library's function, for handles in a unique_ptr. For formats/ only.
#pragma once

namespace qmpipe {

template <auto Free>
struct FreeWith {
  template <class T>
  void operator()(T* pointer) const {
    Free(pointer);
  }
};

}  // namespace qmpipe
