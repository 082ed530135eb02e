// Whether a detail-increment model is whole: what its file's reader refuses and its writer
// requires.
//
// Tells of every index, size and number by itself. Not of whether the triangles are a surface and
// each split can be: stages/detail_model/block.h finds that out on its walk.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "formats/bytes/result.h"
#include "formats/detail_model/data.h"

namespace qmpipe {

struct DetailBlockSize {
  std::uint64_t coarse_points = 0;
  std::uint64_t coarse_triangles = 0;
  std::uint64_t splits = 0;
  friend bool operator==(const DetailBlockSize&, const DetailBlockSize&) = default;
};

// A model without its arrays.
struct DetailSummary {
  DetailFrame frame;
  std::string crs_wkt;  // empty: unknown
  std::uint32_t interval = 1;
  std::vector<DetailBlockSize> blocks;
  std::uint64_t seams = 0;
  friend bool operator==(const DetailSummary&, const DetailSummary&) = default;
};

// REQUIRES: no block has more splits than points.
DetailSummary summary_of(const DetailModel& model);

// No block; more points or half-edges than 32 bits number; an interval of 0; a frame that is not
// finite or whose steps are not positive.
std::optional<Error> fault_of(const DetailSummary& summary);

// Indices of the coarsest mesh and of the splits. REQUIRES: no more splits than points.
std::optional<Error> fault_of_topology(const DetailBlock& block);
// Points outside the grid; an svo_m that is not one number for each level, finite, at least +0 and
// not rising. REQUIRES: as above.
std::optional<Error> fault_of_values(const DetailBlock& block);
// Corners that are not there. REQUIRES: as above, of all blocks.
std::optional<Error> fault_of_seams(const DetailModel& model);

}  // namespace qmpipe
