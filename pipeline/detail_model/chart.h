// The relation of threshold, distance and triangles of a detail-increment model, as Figure 14 of
// Ai et al. 2019 shows it for one block.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/detail_model/data.h"
#include "pipeline/detail_model/extract.h"

namespace qmpipe {

// What is shown under one threshold.
struct DetailState {
  double svo_m = 0;
  // From which the threshold is as long as the view's pixels.
  double distance_m = 0;
  std::int64_t triangles = 0;
  std::int64_t simplifications = 0;
};

// Of one block, or of all: `count` thresholds at even ratios, from the finest level's to the coarsest's.
// REQUIRES: count >= 2; block < blocks.
std::vector<DetailState> block_states(const DetailModel& model, std::size_t block,
                                      const DetailView& view, std::size_t count);
std::vector<DetailState> model_states(const DetailModel& model, const DetailView& view,
                                      std::size_t count);

// A page of its own with charts of all blocks: no scripts, nothing from elsewhere.
std::string detail_chart_page(const DetailModel& model, const DetailView& view,
                              const std::string& title);

}  // namespace qmpipe
