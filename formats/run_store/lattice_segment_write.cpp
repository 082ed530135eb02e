#include <hdf5.h>

#include <limits>

#include "formats/bytes/hash64.h"
#include "formats/hdf5/segment.h"
#include "formats/run_store/lattice_segment.h"
#include "formats/run_store/lattice_window.h"
#include "scheduler/check.h"

namespace qmpipe {
std::uint64_t content_hash(const BlockKey& key, std::span<const std::uint8_t> chunk) {
  return hash64(chunk, packed(key));
}

EncodedSegment encode_lattice_segment(
    const std::filesystem::path& path, const TilingScheme& scheme,
    const std::vector<std::shared_ptr<const PackedBlock>>& blocks) {
  QMPIPE_CHECK(!blocks.empty() && blocks.size() <= kMaxSegmentBlocks);
  EncodedSegment segment;
  std::vector<std::int32_t> keys;
  std::vector<std::uint8_t> is_void;
  std::vector<std::uint64_t> hashes;
  Hdf5SegmentWriter writer(path, store_identity(kSegmentFormatVersion, scheme));
  // So that a block without a chunk reads as void.
  const float fill_m = std::numeric_limits<float>::quiet_NaN();
  writer.create_chunked("blocks", H5T_IEEE_F32LE, {blocks.size(), kBlockPosts, kBlockPosts},
                        {1, kBlockPosts, kBlockPosts}, H5T_NATIVE_FLOAT, &fill_m);
  for (const auto& block : blocks) {
    if (!block->chunk.empty()) writer.write_chunk(segment.entries.size(), block->chunk);
    keys.insert(keys.end(), {block->key.zoom, block->key.x, block->key.y});
    is_void.push_back(block->chunk.empty() ? 1 : 0);
    hashes.push_back(block->content_hash);
    segment.entries.push_back(
        {.key = block->key, .chunk = {}, .content_hash = block->content_hash});
  }
  writer.write_values("keys", 3, keys);
  writer.write_values("is_void", 1, is_void);
  writer.write_values("content_hash", 1, hashes);
  Hdf5SegmentWriter::Finished finished = writer.finish();
  segment.bytes = std::move(finished.bytes);
  for (const LocatedChunk& chunk : finished.chunks) {
    segment.entries.at(chunk.row).chunk = chunk.range;
  }
  return segment;
}

}  // namespace qmpipe
