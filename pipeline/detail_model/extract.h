// Which level of each block of a detail-increment model is to be shown, and the mesh of a choice of
// levels (Ai et al. 2019, sections 2.3.1 and 2.3.2).
//
// Guarantees: whatever the levels, the mesh is one surface without cracks, because no level changes a
// block's rim.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "formats/bytes/result.h"
#include "formats/detail_model/data.h"
#include "formats/tile/mesh_export.h"

namespace qmpipe {

// Of each block.
using DetailLevels = std::vector<std::size_t>;

// A perspective view; the paper's experiment has 2 pixels.
struct DetailView {
  double fov_deg = 60;          // vertical, the whole angle
  double screen_height = 1080;  // pixels
  double pixels = 2;            // how long the smallest visible object may be on the screen
};

// The threshold d of an object at a distance: what is as long as `pixels` on the screen.
double svo_at_distance_m(double distance_m, const DetailView& view);

// The coarsest level of each block whose smallest visible object is no larger; the finest where none
// is.
DetailLevels levels_for_svo(const DetailModel& model, double svo_m);
// The finest levels under one threshold whose triangles, seams among them, are no more than `most`; the
// coarsest where even they are more.
DetailLevels levels_for_triangles(const DetailModel& model, std::int64_t most);
// The same level everywhere, or a block's finest.
DetailLevels levels_at(const DetailModel& model, std::size_t level);
// Each block by its own distance from the eye, which is measured to the middle of its box.
DetailLevels levels_from_eye(const DetailModel& model, const std::array<double, 3>& eye_m,
                             const DetailView& view);
double distance_to_block_m(const DetailModel& model, std::size_t block,
                           const std::array<double, 3>& eye_m);

std::int64_t triangles_of(const DetailModel& model, const DetailLevels& levels);

// Points in use only, block by block; positions as the frame has them. An error names the block whose
// splits are damaged.
Result<ExportMesh> extract_mesh(const DetailModel& model, const DetailLevels& levels);

}  // namespace qmpipe
