#include "stages/finish/mesh_order.h"

#include <meshoptimizer.h>

#include "scheduler/check.h"

namespace qmpipe {

Tin strip_ordered(const Tin& tin) {
  Tin ordered;
  ordered.indices.resize(tin.indices.size());
  meshopt_optimizeVertexCacheStrip(ordered.indices.data(), tin.indices.data(), tin.indices.size(),
                                   tin.vertices.size());
  std::vector<std::uint32_t> remap(tin.vertices.size());
  const std::size_t used = meshopt_optimizeVertexFetchRemap(
      remap.data(), ordered.indices.data(), ordered.indices.size(), tin.vertices.size());
  QMPIPE_CHECK(used == tin.vertices.size());
  for (std::uint32_t& index : ordered.indices) index = remap[index];
  ordered.vertices.resize(tin.vertices.size());
  for (std::size_t k = 0; k < remap.size(); ++k) ordered.vertices[remap[k]] = tin.vertices[k];
  return ordered;
}

}  // namespace qmpipe
