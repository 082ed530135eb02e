#include "formats/crs/gdal_session.h"

#include <cpl_error.h>
#include <cpl_vsi.h>
#include <gdal.h>
#include <hdf5.h>

#include <memory>
#include <mutex>
#include <string_view>

namespace qmpipe {
namespace {

// More than a block and what decodes it take.
constexpr std::size_t kRoomBytes = std::size_t{32} << 20U;

void CPL_STDCALL keep_message(CPLErr severity, CPLErrorNum number, const char* message) {
  auto* session = static_cast<GdalSession*>(CPLGetErrorHandlerUserData());
  if (session != nullptr) session->note(severity, number, message);
}

void register_drivers() {
  static std::once_flag once;
  std::call_once(once, GDALAllRegister);
}

}  // namespace

GdalSession::GdalSession() {
  register_drivers();
  CPLPushErrorHandlerEx(keep_message, this);
  // The HDF5 library under the NetCDF and BAG drivers prints its own errors, thread by thread.
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
}

GdalSession::~GdalSession() { CPLPopErrorHandler(); }

void GdalSession::note(int severity, int number, const char* message) {
  if (severity >= CE_Failure) {
    failed_ = true;
    lacked_memory_ = lacked_memory_ || number == CPLE_OutOfMemory ||
                     std::string_view(message).find("emory") != std::string_view::npos;
    last_error_ = message;
  } else if (severity == CE_Warning) {
    last_warning_ = message;
  }
}

bool GdalSession::lacks_memory() const {
  if (lacked_memory_) return true;
  const std::unique_ptr<void, void (*)(void*)> room(VSIMalloc(kRoomBytes), VSIFree);
  return room == nullptr;
}

std::string GdalSession::cause(const std::string& otherwise) const {
  if (failed_ && lacks_memory()) return "out of memory (" + last_error_ + ")";
  if (!last_error_.empty()) return last_error_;
  return last_warning_.empty() ? otherwise : last_warning_;
}

}  // namespace qmpipe
