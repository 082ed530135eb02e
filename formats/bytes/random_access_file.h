// A file that stays open, read and written at any place.
// const use is safe from several threads, sync() beside it too.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "formats/bytes/result.h"

namespace qmpipe {

class RandomAccessFile {
 public:
  // Throws IoError when it cannot be opened or is no regular file.
  static RandomAccessFile open_to_read(const std::filesystem::path& path);
  // An older file of that name is emptied. Throws IoError.
  static RandomAccessFile create(const std::filesystem::path& path);
  ~RandomAccessFile();
  RandomAccessFile(RandomAccessFile&& other) noexcept;
  RandomAccessFile(const RandomAccessFile&) = delete;
  RandomAccessFile& operator=(const RandomAccessFile&) = delete;

  const std::filesystem::path& path() const { return path_; }
  // When it was opened.
  std::uint64_t size_bytes() const { return size_bytes_; }
  // Refuses what ends after the file's size, before memory is taken for it.
  Result<std::vector<std::uint8_t>> read(std::uint64_t offset, std::uint64_t bytes) const;
  // The file grows where it must. Throws IoError with the system's reason and a remedy.
  void write(std::uint64_t offset, std::span<const std::uint8_t> bytes);
  // What was written before is on the disk after it. Throws IoError.
  void sync() const;
  // Where a network's file system reports a full disk. Throws IoError; then the file is closed too.
  void close();

 private:
  RandomAccessFile(std::filesystem::path path, int descriptor);

  std::filesystem::path path_;
  int descriptor_;
  std::uint64_t size_bytes_ = 0;
};

}  // namespace qmpipe
