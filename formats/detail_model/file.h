// The file of a detail-increment model: HDF5 with zstd (docs/DETAIL_FORMAT.md has the layout).
//
// Guarantees: what is read is bit for bit what was written; the same model gives the same bytes.
// A file that was damaged, cut off or made by something else is refused before HDF5 sees it, by
// its seal (formats/bytes/seal.h); behind the seal every size and index is checked once more
// (formats/detail_model/check.h), and memory grows with what the file's bytes hold, not with what they claim.
// Errors name the file and a remedy. Different threads may use these functions at once where HDF5
// was built thread-safe, and different files.
#pragma once

#include <cstdint>
#include <filesystem>

#include "formats/bytes/result.h"
#include "formats/detail_model/check.h"
#include "formats/detail_model/data.h"

namespace qmpipe {

inline constexpr std::int32_t kDetailFormatVersion = 1;

// Under a temporary name, then renamed: an older file of that name stays until the new one is
// whole. REQUIRES: a model without fault. Throws IoError, also for a crs_wkt of more than some
// 64,000 bytes.
void write_detail_file(const std::filesystem::path& path, const DetailModel& model);

Result<DetailModel> read_detail_file(const std::filesystem::path& path);

// Without the arrays, whose bytes only the seal has checked.
Result<DetailSummary> read_detail_summary(const std::filesystem::path& path);

}  // namespace qmpipe
