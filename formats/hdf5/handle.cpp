#include "formats/hdf5/handle.h"

#include <hdf5.h>

#include <type_traits>

#include "formats/bytes/errors.h"

namespace qmpipe {

static_assert(std::is_same_v<Hdf5Handle::Close, herr_t (*)(hid_t)>);

void silence_hdf5() { H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr); }

std::string hdf5_cause() {
  std::string cause;
  const auto keep_first = [](unsigned /*n*/, const H5E_error2_t* error, void* text) -> herr_t {
    if (error->desc != nullptr) *static_cast<std::string*>(text) = error->desc;
    return 1;
  };
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, keep_first, &cause);
  return cause.empty() ? "the HDF5 library gives no reason" : cause;
}

void require_thread_safe_hdf5(const std::filesystem::path& path) {
  hbool_t is_safe = false;
  if (H5is_library_threadsafe(&is_safe) >= 0 && is_safe) return;
  throw IoError("cannot use the HDF5 library for", path.string(),
                "it was built without thread safety",
                "Install an HDF5 library that was configured with --enable-threadsafe.");
}

}  // namespace qmpipe
