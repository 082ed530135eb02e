#include <fmt/format.h>

#include <limits>
#include <system_error>

#include "formats/bytes/file_bytes.h"
#include "formats/detail_model/arrays.h"
#include "formats/detail_model/file.h"
#include "formats/detail_model/file_layout.h"

namespace qmpipe {
namespace {

constexpr std::size_t kMostModelCrsBytes = 65536;
// No frame of zstd is smaller.
constexpr std::uint64_t kLeastChunkBytes = 8;

// A dataset of one value.
Result<std::uint64_t> single_value(const Hdf5SegmentReader& file, const char* name) {
  const auto values = file.values<std::uint64_t>(name, 1, 1);
  if (!values) return values.error();
  return values->front();
}

Result<DetailFrame> read_frame(const Hdf5SegmentReader& file) {
  const auto values = file.values<double>(kDetailFrame, 3, 2);
  if (!values) return values.error();
  if (values->size() != 6) return file.refused_shape(kDetailFrame);
  DetailFrame frame;
  for (std::size_t k = 0; k < 3; ++k) {
    frame.offset[k] = (*values)[k];
    frame.step_m[k] = (*values)[3 + k];
  }
  return frame;
}

Result<DetailSummary> read_summary(const Hdf5SegmentReader& file, std::uint64_t file_bytes) {
  auto crs_wkt = file.text(kDetailCrs, kMostModelCrsBytes);
  if (!crs_wkt) return crs_wkt.error();
  const auto frame = read_frame(file);
  if (!frame) return frame.error();
  const auto interval = single_value(file, kDetailInterval);
  if (!interval) return interval.error();
  if (*interval > std::numeric_limits<std::uint32_t>::max()) {
    return file.refused(fmt::format("its interval is {}", *interval));
  }
  const auto seams = single_value(file, kDetailSeams);
  if (!seams) return seams.error();
  const auto blocks =
      file.values<std::uint64_t>(kDetailBlocks, kDetailBlockColumns,
                                 file_bytes / (kDetailBlockColumns * sizeof(std::uint64_t)));
  if (!blocks) return blocks.error();
  DetailSummary summary = {.frame = *frame,
                           .crs_wkt = std::move(*crs_wkt),
                           .interval = static_cast<std::uint32_t>(*interval),
                           .blocks = {},
                           .seams = *seams};
  for (std::size_t k = 0; k < blocks->size(); k += kDetailBlockColumns) {
    summary.blocks.push_back({.coarse_points = (*blocks)[k],
                              .coarse_triangles = (*blocks)[k + 1],
                              .splits = (*blocks)[k + 2]});
  }
  if (const auto error = fault_of(summary)) return file.refused(error->message);
  return summary;
}

// Where the chunks of an array are, in order: as many as its length needs.
Result<std::vector<ByteRange>> locate_array(const Hdf5SegmentReader& file, const char* name,
                                            std::uint64_t words, std::uint64_t file_bytes) {
  const auto data =
      file.chunked(name, file_bytes / kLeastChunkBytes + 1, largest_word_chunk_bytes());
  if (!data) return data.error();
  const std::uint64_t chunk_words = chunk_words_of(words);
  const std::uint64_t count = (words + chunk_words - 1) / chunk_words;
  if (data->shape != std::vector{words} || data->chunk_shape != std::vector{chunk_words} ||
      data->element_bytes != sizeof(std::uint32_t) || data->chunks.size() != count) {
    return file.refused_shape(name);
  }
  std::vector<ByteRange> ranges(count);
  for (const LocatedChunk& chunk : data->chunks) {
    if (chunk.row % chunk_words != 0 || chunk.row >= words || chunk.range.bytes == 0) {
      return file.refused_shape(name);
    }
    ranges[chunk.row / chunk_words] = chunk.range;
  }
  // One named twice leaves another without bytes.
  const bool has_all = std::all_of(ranges.begin(), ranges.end(),
                                   [](const ByteRange& range) { return range.bytes > 0; });
  if (!has_all) return file.refused_shape(name);
  return ranges;
}

Result<std::vector<std::uint32_t>> read_array(const std::filesystem::path& path,
                                              const Hdf5SegmentReader& file, const char* name,
                                              std::uint64_t words, std::uint64_t file_bytes) {
  std::vector<std::uint32_t> values;
  if (words == 0) return values;
  const auto ranges = locate_array(file, name, words, file_bytes);
  if (!ranges) return ranges.error();
  const std::uint64_t chunk_words = chunk_words_of(words);
  for (const ByteRange& range : *ranges) {
    const auto chunk = read_file_range(path, range.offset, range.bytes);
    if (!chunk) return chunk.error();
    const auto part = unpack_words(
        *chunk, std::min<std::uint64_t>(chunk_words, words - values.size()), chunk_words);
    if (!part) return file.refused(fmt::format("a chunk of `{}`: {}", name, part.error().message));
    values.insert(values.end(), part->begin(), part->end());
  }
  return values;
}

struct OpenedModel {
  Hdf5SegmentReader file;
  DetailSummary summary;
  std::uint64_t bytes;
};

Result<OpenedModel> open(const std::filesystem::path& path) {
  auto file = Hdf5SegmentReader::open(path, detail_identity());
  if (!file) return file.error();
  std::error_code code;
  const std::uint64_t bytes = std::filesystem::file_size(path, code);
  if (code) return file->refused(code.message());
  auto summary = read_summary(*file, bytes);
  if (!summary) return summary.error();
  return OpenedModel{.file = std::move(*file), .summary = std::move(*summary), .bytes = bytes};
}

}  // namespace

Result<DetailSummary> read_detail_summary(const std::filesystem::path& path) {
  auto opened = open(path);
  if (!opened) return opened.error();
  return std::move(opened->summary);
}

Result<DetailModel> read_detail_file(const std::filesystem::path& path) {
  const auto opened = open(path);
  if (!opened) return opened.error();
  const auto lengths = array_lengths(opened->summary);
  std::uint64_t words = 0;
  for (const std::uint64_t length : lengths) words += std::min(length, opened->bytes << 10U);
  if (words > most_array_bytes(opened->bytes) / sizeof(std::uint32_t)) {
    return opened->file.refused(
        fmt::format("it claims more than its {} bytes can hold", opened->bytes));
  }
  DetailArrays arrays;
  for (std::size_t k = 0; k < kDetailArrayCount; ++k) {
    auto values = read_array(path, opened->file, kDetailArrayNames[k], lengths[k], opened->bytes);
    if (!values) return values.error();
    arrays[k] = std::move(*values);
  }
  auto model = decode_detail(opened->summary, arrays);
  if (!model) return opened->file.refused(model.error().message);
  return model;
}

}  // namespace qmpipe
