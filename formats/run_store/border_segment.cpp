#include "formats/run_store/border_segment.h"

#include <fmt/format.h>
#include <hdf5.h>

#include <algorithm>
#include <optional>
#include <span>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"
#include "formats/bytes/hash64.h"
#include "formats/hdf5/handle.h"
#include "formats/hdf5/segment.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

constexpr std::size_t kMaxChunks = kMaxSegmentBorders / kMaxChunkBorders;
constexpr std::size_t kKeyColumns = 4;

std::uint64_t hash_of(const BorderKey& first, std::span<const std::uint8_t> chunk) {
  return hash64(chunk, packed(first));
}

void append_key(std::vector<std::int32_t>& values, const BorderKey& key) {
  values.insert(values.end(), {key.owner.zoom, key.owner.x, key.owner.y,
                               static_cast<std::int32_t>(index_of(key.side))});
}

// HDF5's type of a record.
Hdf5Handle make_record_type(const std::filesystem::path& path) {
  const hsize_t mask_bytes = kMaskBytes;
  const Hdf5Handle mask(H5Tarray_create2(H5T_STD_U8LE, 1, &mask_bytes), H5Tclose);
  Hdf5Handle record(H5Tcreate(H5T_COMPOUND, kBorderBytes), H5Tclose);
  if (!mask.ok() || !record.ok() || H5Tinsert(record.id(), "zoom", 0, H5T_STD_I32LE) < 0 ||
      H5Tinsert(record.id(), "x", 4, H5T_STD_I32LE) < 0 ||
      H5Tinsert(record.id(), "y", 8, H5T_STD_I32LE) < 0 ||
      H5Tinsert(record.id(), "side", 12, H5T_STD_U8LE) < 0 ||
      H5Tinsert(record.id(), "mask", 13, mask.id()) < 0) {
    throw IoError("cannot make the HDF5 file", path.string(), hdf5_cause(), "");
  }
  return record;
}

bool is_in(const TilingScheme& scheme, std::int32_t max_zoom, const TileKey& key) {
  return key.zoom >= 0 && key.zoom <= max_zoom && scheme.contains(key);
}

// The first or last border of each chunk.
Result<std::vector<BorderKey>> read_keys(const Hdf5SegmentReader& file, const char* name,
                                         const TilingScheme& scheme, std::int32_t max_zoom) {
  const auto values = file.values<std::int32_t>(name, kKeyColumns, kMaxChunks);
  if (!values) return values.error();
  std::vector<BorderKey> keys;
  for (std::size_t k = 0; k < values->size(); k += kKeyColumns) {
    const TileKey owner = {.zoom = (*values)[k], .x = (*values)[k + 1], .y = (*values)[k + 2]};
    const std::int32_t side = (*values)[k + 3];
    if (!is_in(scheme, max_zoom, owner) || side < 0 || side >= std::ssize(kSides)) {
      return file.refused(
          fmt::format("its border {} side {} lies outside the {} scheme of zooms 0 to {}",
                      to_string(owner), side, segment_scheme_name(scheme), max_zoom));
    }
    keys.push_back({.owner = owner, .side = static_cast<Side>(side)});
  }
  return keys;
}

// Where the chunks are and how many borders they have.
Result<std::vector<BorderChunk>> locate_chunks(const Hdf5SegmentReader& file) {
  const auto data = file.chunked("borders", kMaxChunks, largest_border_chunk_bytes());
  if (!data) return data.error();
  if (data->shape.size() != 1 || data->element_bytes != kBorderBytes || data->shape[0] < 1 ||
      data->shape[0] > kMaxSegmentBorders) {
    return file.refused_shape("borders");
  }
  const std::uint64_t borders = data->shape[0];
  const std::uint64_t records = std::min<std::uint64_t>(borders, kMaxChunkBorders);
  const std::uint64_t count = (borders + records - 1) / records;
  if (data->chunk_shape[0] != records || data->chunks.size() != count) {
    return file.refused_shape("borders");
  }
  std::vector<BorderChunk> chunks(count);
  for (const LocatedChunk& located : data->chunks) {
    if (located.row % records != 0 || located.row >= borders || located.range.bytes == 0) {
      return file.refused_shape("borders");
    }
    BorderChunk& chunk = chunks[located.row / records];
    chunk.range = located.range;
    chunk.count = static_cast<std::uint32_t>(std::min(records, borders - located.row));
    chunk.records = static_cast<std::uint32_t>(records);
  }
  const bool has_all = std::all_of(chunks.begin(), chunks.end(),
                                   [](const BorderChunk& chunk) { return chunk.count > 0; });
  if (!has_all) return file.refused_shape("borders");
  return chunks;
}

bool is_ascending(const std::vector<BorderChunk>& chunks) {
  for (std::size_t k = 0; k < chunks.size(); ++k) {
    const bool is_one = chunks[k].first == chunks[k].last;
    if (is_one != (chunks[k].count == 1) || chunks[k].first > chunks[k].last) return false;
    if (k > 0 && chunks[k - 1].last >= chunks[k].first) return false;
  }
  return true;
}

}  // namespace

EncodedBorderSegment encode_border_segment(const std::filesystem::path& path,
                                           const TilingScheme& scheme,
                                           const std::vector<Border>& borders, int level) {
  QMPIPE_CHECK(!borders.empty() && borders.size() <= kMaxSegmentBorders);
  const std::size_t records = std::min(borders.size(), kMaxChunkBorders);
  EncodedBorderSegment segment;
  std::vector<std::int32_t> firsts;
  std::vector<std::int32_t> lasts;
  std::vector<std::uint64_t> hashes;
  Hdf5SegmentWriter writer(path, store_identity(kBorderSegmentVersion, scheme));
  const Hdf5Handle type = make_record_type(path);
  writer.create_chunked("borders", type.id(), {borders.size()}, {records}, type.id(), nullptr);
  for (std::size_t row = 0; row < borders.size(); row += records) {
    const auto batch = std::span(borders).subspan(row, std::min(records, borders.size() - row));
    const std::vector<std::uint8_t> chunk = pack_borders(batch, records, level);
    writer.write_chunk(row, chunk);
    segment.chunks.push_back({.first = batch.front().key,
                              .last = batch.back().key,
                              .range = {},
                              .content_hash = hash_of(batch.front().key, chunk),
                              .count = static_cast<std::uint32_t>(batch.size()),
                              .records = static_cast<std::uint32_t>(records)});
    append_key(firsts, batch.front().key);
    append_key(lasts, batch.back().key);
    hashes.push_back(segment.chunks.back().content_hash);
  }
  writer.write_values("chunk_first", kKeyColumns, firsts);
  writer.write_values("chunk_last", kKeyColumns, lasts);
  writer.write_values("content_hash", 1, hashes);
  Hdf5SegmentWriter::Finished finished = writer.finish();
  segment.bytes = std::move(finished.bytes);
  for (const LocatedChunk& chunk : finished.chunks) {
    segment.chunks.at(chunk.row / records).range = chunk.range;
  }
  return segment;
}

Result<std::vector<BorderChunk>> read_border_segment(const std::filesystem::path& path,
                                                     const TilingScheme& scheme,
                                                     std::int32_t max_zoom) {
  const auto file = Hdf5SegmentReader::open(path, store_identity(kBorderSegmentVersion, scheme));
  if (!file) return file.error();
  auto chunks = locate_chunks(*file);
  if (!chunks) return chunks;
  const auto firsts = read_keys(*file, "chunk_first", scheme, max_zoom);
  if (!firsts) return firsts.error();
  const auto lasts = read_keys(*file, "chunk_last", scheme, max_zoom);
  if (!lasts) return lasts.error();
  const auto hashes = file->values<std::uint64_t>("content_hash", 1, kMaxChunks);
  if (!hashes) return hashes.error();
  if (firsts->size() != chunks->size() || lasts->size() != chunks->size() ||
      hashes->size() != chunks->size()) {
    return file->refused("its datasets have different lengths");
  }
  for (std::size_t k = 0; k < chunks->size(); ++k) {
    (*chunks)[k].first = (*firsts)[k];
    (*chunks)[k].last = (*lasts)[k];
    (*chunks)[k].content_hash = (*hashes)[k];
  }
  if (!is_ascending(*chunks)) return file->refused("its borders are out of order");
  return chunks;
}

Result<std::vector<Border>> read_border_chunk(const std::filesystem::path& path,
                                              const BorderChunk& chunk) {
  const auto bytes = read_file_range(path, chunk.range.offset, chunk.range.bytes);
  if (!bytes) return bytes.error();
  if (hash_of(chunk.first, *bytes) != chunk.content_hash) {
    return Error{"its bytes are not those that were written"};
  }
  auto borders = unpack_borders(*bytes, chunk.count, chunk.records);
  if (!borders) return borders;
  if (borders->front().key != chunk.first || borders->back().key != chunk.last) {
    return Error{"it holds other borders than the index says"};
  }
  return borders;
}

}  // namespace qmpipe
