// Where the data end: how high their rim stands, and so over which distance the ground outside them
// may fade to 0 m without a cliff.
#pragma once

#include <span>

#include "pipeline/survey/survey.h"

namespace qmpipe {

// How far from 0 m the valid posts of a window with a void beside them reach. A pole row is no
// neighbour: it has a height wherever the data reach it. REQUIRES: a height or NaN for each post.
float rim_of(const Lattice& lattice, const PostWindow& window, std::span<const float> heights_m);

// The policy with its base zoom: the deepest one whose posts are, on the ground, as far apart as the
// policy's fade_m; without one, at least four times as far as the rim stands from 0 m, there and at
// every coarser zoom. The slope outside the data is then a quarter at most.
VoidPolicy settled_policy(VoidPolicy policy, const Survey& survey);

}  // namespace qmpipe
