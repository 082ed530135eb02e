#include "formats/gdal_session.h"

#include <cpl_error.h>
#include <gdal.h>
#include <hdf5.h>

#include <mutex>

namespace qmpipe {
namespace {

void CPL_STDCALL keep_message(CPLErr severity, CPLErrorNum /*number*/, const char* message) {
  auto* session = static_cast<GdalSession*>(CPLGetErrorHandlerUserData());
  if (session != nullptr) session->note(severity, message);
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

void GdalSession::note(int severity, const char* message) {
  if (severity >= CE_Failure) {
    failed_ = true;
    last_error_ = message;
  } else if (severity == CE_Warning) {
    last_warning_ = message;
  }
}

std::string GdalSession::cause(const std::string& otherwise) const {
  if (!last_error_.empty()) return last_error_;
  return last_warning_.empty() ? otherwise : last_warning_;
}

}  // namespace qmpipe
