#include <fmt/format.h>

#include "formats/hdf5/segment.h"
#include "formats/run_store/block_codec.h"
#include "formats/run_store/lattice_segment.h"
#include "formats/run_store/lattice_window.h"

namespace qmpipe {
namespace {

// The bytes of each block; none for one that is void.
Result<std::vector<ByteRange>> locate_blocks(const Hdf5SegmentReader& file, std::size_t rows) {
  const auto data = file.chunked("blocks", rows, BlockCodec::largest_chunk_bytes());
  if (!data) return data.error();
  const std::vector<std::uint64_t> shape = {rows, kBlockPosts, kBlockPosts};
  const std::vector<std::uint64_t> chunk_shape = {1, kBlockPosts, kBlockPosts};
  if (data->shape != shape || data->chunk_shape != chunk_shape ||
      data->element_bytes != sizeof(float)) {
    return file.refused_shape("blocks");
  }
  std::vector<ByteRange> ranges(rows);
  for (const LocatedChunk& chunk : data->chunks) {
    if (chunk.row >= rows) return file.refused_shape("blocks");
    ranges[chunk.row] = chunk.range;
  }
  return ranges;
}

}  // namespace

Result<std::vector<SegmentEntry>> read_lattice_segment(const std::filesystem::path& path,
                                                       const TilingScheme& scheme,
                                                       std::int32_t max_zoom) {
  const auto file = Hdf5SegmentReader::open(path, store_identity(kSegmentFormatVersion, scheme));
  if (!file) return file.error();
  const auto keys = file->values<std::int32_t>("keys", 3, kMaxSegmentBlocks);
  if (!keys) return keys.error();
  const auto is_void = file->values<std::uint8_t>("is_void", 1, kMaxSegmentBlocks);
  if (!is_void) return is_void.error();
  const auto hashes = file->values<std::uint64_t>("content_hash", 1, kMaxSegmentBlocks);
  if (!hashes) return hashes.error();
  const std::size_t rows = is_void->size();
  if (keys->size() != 3 * rows || hashes->size() != rows) {
    return file->refused("its datasets have different lengths");
  }
  const auto chunks = locate_blocks(*file, rows);
  if (!chunks) return chunks.error();
  std::vector<SegmentEntry> entries(rows);
  for (std::size_t k = 0; k < rows; ++k) {
    SegmentEntry& entry = entries[k];
    entry.key = {.zoom = (*keys)[3 * k], .x = (*keys)[3 * k + 1], .y = (*keys)[3 * k + 2]};
    entry.chunk = (*chunks)[k];
    entry.content_hash = (*hashes)[k];
    if (!is_block_of(scheme, max_zoom, entry.key)) {
      return file->refused(fmt::format("its block {} lies outside the {} scheme of zooms 0 to {}",
                                       to_string(entry.key), segment_scheme_name(scheme),
                                       max_zoom));
    }
    if ((*is_void)[k] != (entry.chunk.bytes == 0 ? 1 : 0)) {
      return file->refused(fmt::format("its block {} has no data", to_string(entry.key)));
    }
  }
  return entries;
}

}  // namespace qmpipe
