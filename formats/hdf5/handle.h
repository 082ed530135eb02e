// HDF5's handles and error messages, for the .cpp files that use HDF5.
//
// HDF5's own types do not appear here: an hid_t is a 64-bit integer, an herr_t an int (1.10 on).
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>

namespace qmpipe {

// HDF5 prints its errors, thread by thread; from this call on it is quiet on the calling thread.
void silence_hdf5();

// What failed first in the last call of HDF5 on this thread, in the library's words.
std::string hdf5_cause();

// Throws IoError, naming `path`, when calls of the library from different threads need a lock around
// them all, which nobody can hold: GDAL calls HDF5 too.
void require_thread_safe_hdf5(const std::filesystem::path& path);

// Closes what it holds.
class Hdf5Handle {
 public:
  using Close = int (*)(std::int64_t);
  Hdf5Handle(std::int64_t id, Close close) : id_(id), close_(close) {}
  Hdf5Handle(Hdf5Handle&& other) noexcept
      : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
  Hdf5Handle& operator=(Hdf5Handle&&) = delete;
  ~Hdf5Handle() {
    if (ok()) close_(id_);
  }

  bool ok() const { return id_ >= 0; }
  std::int64_t id() const { return id_; }

 private:
  std::int64_t id_;
  Close close_;
};

}  // namespace qmpipe
