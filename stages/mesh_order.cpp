#include "stages/mesh_order.h"

#include <meshoptimizer.h>

#include "scheduler/check.h"

namespace qmpipe {

Tin strip_ordered(const Tin& tin) {
  Tin ordered;
  ordered.indices.resize(tin.indices.size());
  meshopt_optimizeVertexCacheStrip(ordered.indices.data(), tin.indices.data(), tin.indices.size(),
                                   tin.posts.size());
  std::vector<std::uint32_t> remap(tin.posts.size());
  const std::size_t used = meshopt_optimizeVertexFetchRemap(
      remap.data(), ordered.indices.data(), ordered.indices.size(), tin.posts.size());
  QMPIPE_CHECK(used == tin.posts.size());
  for (std::uint32_t& index : ordered.indices) index = remap[index];
  ordered.posts.resize(tin.posts.size());
  for (std::size_t k = 0; k < tin.posts.size(); ++k) ordered.posts[remap[k]] = tin.posts[k];
  return ordered;
}

}  // namespace qmpipe
