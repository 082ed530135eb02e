// Where a set's data are, as a coarse picture of the ground: what a page needs to tell them from the
// heights that were made up around them and in their holes.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/survey/survey.h"

namespace qmpipe {

// Posts in rows and columns that are evenly spaced in the scheme's projection.
struct DataCover {
  // The outermost posts; east is more than 180 across the antimeridian.
  RectangleDeg posts_deg;
  std::int32_t columns = 0;
  // From the south. The posts of each from the west, by turns: so many voids, so many with a height, so
  // many voids ...; the first number may be 0, voids at the end are left out.
  std::vector<std::vector<std::int32_t>> rows;
  friend bool operator==(const DataCover&, const DataCover&) = default;
};

// The posts of the deepest zoom on which the data are at most 160 wide and high, or of zoom 0: a coarse
// post has a height where a finer one near it has. A pole row has a height everywhere where the data reach
// the pole. Nothing where no post but poles has a height. Throws IoError when the lattice cannot be read.
std::optional<DataCover> data_cover(const Survey& survey);

// The JSON object of a recipe with the cover as its member "data":
// {"posts_deg":[west,south,east,north],"columns":n,"rows":["17: 0 12 3 5",...]}, where 17 rows are alike.
std::string with_cover(const std::string& recipe_json, const DataCover& cover);

}  // namespace qmpipe
