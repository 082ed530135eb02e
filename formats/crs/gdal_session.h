// Keeps GDAL quiet and its drivers registered while we call it.
//
// Guarantees: drivers are registered once per process; while a GdalSession lives, nothing that GDAL
// says on this thread reaches stderr, and the last error is kept for our own message.
// HDF5, which some drivers use, stays quiet on the thread from then on. Sessions nest; each belongs
// to the thread that made it.
#pragma once

#include <string>

namespace qmpipe {

// Where lacks_memory() says so.
inline constexpr const char* kNoMemoryRemedy =
    "give less to do at a time (--threads 1), or a smaller --memory";

class GdalSession {
 public:
  GdalSession();
  ~GdalSession();
  GdalSession(const GdalSession&) = delete;
  GdalSession& operator=(const GdalSession&) = delete;

  // What GDAL complained about since this session began, or `otherwise` when it said nothing. It names
  // the memory where that is what was lacking: drivers seldom do.
  std::string cause(const std::string& otherwise) const;
  bool failed() const { return failed_; }
  // Whether GDAL said so, or there is none to be had now.
  bool lacks_memory() const;
  // For GDAL's callback: severities are CPLErr, numbers CPLErrorNum.
  void note(int severity, int number, const char* message);

 private:
  std::string last_error_;
  std::string last_warning_;
  bool failed_ = false;
  bool lacked_memory_ = false;
};

}  // namespace qmpipe
