#include <hdf5.h>

#include <span>

#include "formats/bytes/file_bytes.h"
#include "formats/detail_model/arrays.h"
#include "formats/detail_model/file.h"
#include "formats/detail_model/file_layout.h"

namespace qmpipe {
namespace {

// From here on zstd looks for the cheapest parse: 6 % smaller than at 3, and 15 times as slow,
// which is still a small part of the time that the simplification takes.
constexpr int kZstdLevel = 13;

void write_summary(Hdf5SegmentWriter& file, const DetailSummary& summary) {
  if (!summary.crs_wkt.empty()) file.write_text(kDetailCrs, summary.crs_wkt);
  std::vector<double> frame(summary.frame.offset.begin(), summary.frame.offset.end());
  frame.insert(frame.end(), summary.frame.step_m.begin(), summary.frame.step_m.end());
  file.write_values(kDetailFrame, 3, frame);
  file.write_values(kDetailInterval, 1, std::vector<std::uint64_t>{summary.interval});
  file.write_values(kDetailSeams, 1, std::vector<std::uint64_t>{summary.seams});
  std::vector<std::uint64_t> blocks;
  for (const DetailBlockSize& size : summary.blocks) {
    blocks.insert(blocks.end(), {size.coarse_points, size.coarse_triangles, size.splits});
  }
  file.write_values(kDetailBlocks, kDetailBlockColumns, blocks);
}

void write_array(Hdf5SegmentWriter& file, const char* name, std::span<const std::uint32_t> words) {
  if (words.empty()) return;  // HDF5 has no chunks without a size
  const std::size_t chunk_words = chunk_words_of(words.size());
  file.create_chunked(name, H5T_STD_U32LE, {words.size()}, {chunk_words}, H5T_NATIVE_UINT32,
                      nullptr);
  for (std::size_t row = 0; row < words.size(); row += chunk_words) {
    const auto part = words.subspan(row, std::min(chunk_words, words.size() - row));
    file.write_chunk(row, pack_words(part, chunk_words, kZstdLevel));
  }
}

}  // namespace

void write_detail_file(const std::filesystem::path& path, const DetailModel& model) {
  const DetailArrays arrays = encode_detail(model);
  Hdf5SegmentWriter file(path, detail_identity());
  write_summary(file, summary_of(model));
  for (std::size_t k = 0; k < kDetailArrayCount; ++k) {
    write_array(file, kDetailArrayNames[k], arrays[k]);
  }
  std::uint64_t array_bytes = 0;
  for (const std::vector<std::uint32_t>& words : arrays) array_bytes += 4 * words.size();
  write_file_atomically(path, file.finish_whole(least_file_bytes(array_bytes)));
}

}  // namespace qmpipe
