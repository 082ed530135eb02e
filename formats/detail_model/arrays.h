// The arrays of a detail-increment model as its file holds them: 32-bit words, small where they
// can be, so that their high bytes are mostly zero and compress away (docs/DETAIL_FORMAT.md has
// the rules).
//
// Guarantees: decoding what was encoded gives the same model, bit for bit; decoding anything else
// gives a model without fault (formats/detail_model/check.h) or an Error, and allocates in proportion to the
// words given.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "formats/bytes/result.h"
#include "formats/detail_model/check.h"
#include "formats/detail_model/data.h"

namespace qmpipe {

enum class DetailArray : std::uint8_t {
  kPointX,
  kPointY,
  kPointZ,
  kCornerA,
  kCornerB,
  kCornerC,
  kHalfEdge,
  kFan,
  kSvo,
  kSeamBlock,
  kSeamPoint,
};
constexpr std::size_t index_of(DetailArray array) { return static_cast<std::size_t>(array); }

// By DetailArray; the blocks' values one block after the other.
inline constexpr std::size_t kDetailArrayCount = 11;
inline constexpr std::array<const char*, kDetailArrayCount> kDetailArrayNames = {
    "point_x",   "point_y", "point_z", "corner_a",   "corner_b",  "corner_c",
    "half_edge", "fan",     "svo",     "seam_block", "seam_point"};
using DetailArrays = std::array<std::vector<std::uint32_t>, kDetailArrayCount>;

// How many values each has. REQUIRES: a summary without fault.
std::array<std::uint64_t, kDetailArrayCount> array_lengths(const DetailSummary& summary);

// REQUIRES: a model without fault.
DetailArrays encode_detail(const DetailModel& model);

// REQUIRES: a summary without fault, arrays of the lengths it says.
Result<DetailModel> decode_detail(const DetailSummary& summary, const DetailArrays& arrays);

}  // namespace qmpipe
