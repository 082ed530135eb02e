// A seal at the end of a file: tells a whole file from a torn or damaged one without trusting it.
//
// HDF5 does not protect its own structure against damage, and may crash on it; so a file of ours is
// checked before HDF5 sees it. HDF5 ignores what follows its own end of file, so other programs
// read a sealed file like any other.
// Guarantees: a file that passes has the length it had when it was sealed, and the same bytes
// everywhere outside the payload (chunks of data, which carry hashes of their own). Layout, all
// numbers 64-bit little-endian:
//   count x (offset, bytes) of the parts outside the payload | their hash | bytes before the seal
//   | count | hash of the seal so far | "QMPSEAL1"
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <vector>

#include "formats/bytes/result.h"

namespace qmpipe {

struct ByteRange {
  std::uint64_t offset = 0;
  std::uint64_t bytes = 0;
};

// REQUIRES: the ranges of `payload` lie within the file and do not overlap; any order.
void append_seal(std::vector<std::uint8_t>& file, std::vector<ByteRange> payload);

// What is wrong with the file at `path`, naming it; nothing when it is as it was sealed. Reads the
// seal and what lies outside the payload.
std::optional<Error> check_seal(const std::filesystem::path& path);

// What stands before the seal. REQUIRES: the whole of a file that check_seal() passed.
std::span<const std::uint8_t> without_seal(std::span<const std::uint8_t> file);

}  // namespace qmpipe
