// Which texts of CRSs say the same, whatever names and digits they have. For formats/ only.
#pragma once

#include <cstddef>
#include <memory>

#include "formats/crs/transform.h"

namespace qmpipe {

// Used by one thread at a time.
class CrsNumbers {
 public:
  CrsNumbers();
  ~CrsNumbers();
  CrsNumbers(const CrsNumbers&) = delete;
  CrsNumbers& operator=(const CrsNumbers&) = delete;

  // The same number for CRSs that lead every x and y to one place (PROJ's equivalence); counted from
  // 0. One that PROJ cannot read is the same as itself only.
  std::size_t number_of(const CrsText& crs);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace qmpipe
