#include "formats/raster/reader.h"

#include <fmt/format.h>
#include <gdal_priv.h>

#include <algorithm>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "formats/bytes/errors.h"
#include "formats/crs/gdal_session.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

// Blocks of fewer pixels are cached several at a time: a look-up costs more than their values.
constexpr std::int64_t kFewPixels = 16'384;
constexpr std::int64_t kJoinedSide = 256;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
// A VRT's blocks are no blocks of a file: what lies below is decoded by GDAL, handle by handle, and
// large windows share less of it.
constexpr std::int64_t kVirtualSide = 1024;

std::int64_t blocks_for(std::int64_t length, std::int64_t block) {
  return (length + block - 1) / block;
}

// As many blocks as `side` pixels hold, one at least, no more than there are.
std::int64_t joined(std::int64_t side, std::int64_t block, std::int64_t length) {
  return std::clamp<std::int64_t>(side / block, 1,
                                  std::max<std::int64_t>(1, blocks_for(length, block)));
}

[[noreturn]] void refuse(const RasterInfo& info, const PixelWindow& window,
                         const GdalSession& session) {
  throw IoError(
      "cannot read the raster", info.path,
      fmt::format("{} (columns {} to {}, rows {} to {})", session.cause("GDAL could not read it"),
                  window.column0, window.column0 + window.width - 1, window.row0,
                  window.row0 + window.height - 1),
      session.lacks_memory()
          ? kNoMemoryRemedy
          : "the file may be truncated or damaged; compare its size with the original");
}

// What a handle keeps for itself after it has read a block: the packed bytes, and of files whose
// bands are interleaved by pixel, all bands of the block.
std::int64_t handle_bytes_of(GDALRasterBand& band, std::int64_t block_bytes) {
  GDALDataset* const dataset = band.GetDataset();
  if (dataset == nullptr) return block_bytes;
  const char* const packing = dataset->GetMetadataItem("COMPRESSION", "IMAGE_STRUCTURE");
  const char* const interleaving = dataset->GetMetadataItem("INTERLEAVE", "IMAGE_STRUCTURE");
  std::int64_t bytes = packing != nullptr ? block_bytes : 0;
  if (dataset->GetRasterCount() > 1 && interleaving != nullptr &&
      std::string(interleaving) == "PIXEL") {
    bytes += block_bytes * dataset->GetRasterCount();
  }
  return bytes;
}

}  // namespace

void describe_blocks(GDALRasterBand& band, bool has_mask, RasterInfo& info) {
  int width = 0;
  int height = 0;
  band.GetBlockSize(&width, &height);
  info.blocks.width = width;
  info.blocks.height = height;
  std::int64_t across = 1;
  std::int64_t down = 1;
  if (info.driver == "VRT") {
    across = joined(kVirtualSide, info.blocks.width, info.width);
    down = joined(kVirtualSide, info.blocks.height, info.height);
  } else if (info.blocks.width * info.blocks.height < kFewPixels) {
    across = joined(kJoinedSide, info.blocks.width, info.width);
    down = joined(kJoinedSide, info.blocks.height, info.height);
    if (info.blocks.width >= info.width) {
      down = joined(kJoinedSide * kJoinedSide / info.blocks.width, info.blocks.height, info.height);
    }
  }
  info.blocks.cached_width = across * info.blocks.width;
  info.blocks.cached_height = down * info.blocks.height;
  const std::int64_t value_bytes = GDALGetDataTypeSizeBytes(band.GetRasterDataType());
  info.blocks.cached_bytes =
      info.blocks.cached_width * info.blocks.cached_height * (value_bytes + (has_mask ? 1 : 0));
  info.blocks.handle_bytes =
      handle_bytes_of(band, info.blocks.width * info.blocks.height * value_bytes);
}

RasterReader::RasterReader(GDALRasterBand& band, bool has_mask, const RasterInfo& info,
                           std::shared_ptr<SourceBlockCache> cache, std::uint32_t source_number,
                           BlockWatcher* watcher)
    : band_(band),
      mask_(has_mask ? band.GetMaskBand() : nullptr),
      info_(info),
      cache_(std::move(cache)),
      source_number_(source_number),
      watcher_(watcher) {
  QMPIPE_CHECK(info.blocks.cached_bytes > 0);
  kind_.type = band.GetRasterDataType();
  kind_.value_bytes = GDALGetDataTypeSizeBytes(band.GetRasterDataType());
  // Only where GDAL's blocks lie one below the other do they fill one of ours in one piece.
  kind_.goes_round_gdal_cache =
      info.driver != "VRT" && (info.blocks.cached_width == info.blocks.width);
  if (mask_ == nullptr) return;
  int width = 0;
  int height = 0;
  mask_->GetBlockSize(&width, &height);
  kind_.mask_is_shaped_alike = mask_->GetRasterDataType() == GDT_Byte &&
                               width == info.blocks.width && height == info.blocks.height;
}

void RasterReader::raster_io(GDALRasterBand& band, const PixelWindow& window, int type, void* into,
                             std::int64_t row_bytes) const {
  const GdalSession session;
  const int width = static_cast<int>(window.width);
  const int height = static_cast<int>(window.height);
  const CPLErr result = band.RasterIO(
      GF_Read, static_cast<int>(window.column0), static_cast<int>(window.row0), width, height, into,
      width, height, static_cast<GDALDataType>(type), 0, row_bytes, nullptr);
  if (result != CE_None) refuse(info_, window, session);
}

void RasterReader::read_past_cache(const PixelWindow& window, std::span<double> values,
                                   std::span<std::uint8_t> mask) const {
  raster_io(band_, window, GDT_Float64, values.data(), 0);
  if (!mask.empty()) raster_io(*mask_, window, GDT_Byte, mask.data(), 0);
}

// The part of the raster that a block of the cache holds: less than the whole block at the edges.
PixelWindow RasterReader::covered_by(std::int64_t column, std::int64_t row) const {
  PixelWindow covered{.column0 = column * info_.blocks.cached_width,
                      .row0 = row * info_.blocks.cached_height};
  covered.width = std::min(info_.blocks.cached_width, info_.width - covered.column0);
  covered.height = std::min(info_.blocks.cached_height, info_.height - covered.row0);
  return covered;
}

// A stack of the file's blocks, each as long as GDAL makes it, beyond the raster's edge too.
void RasterReader::decode_file_blocks(GDALRasterBand& band, const PixelWindow& covered,
                                      std::span<std::uint8_t> bytes) const {
  const GdalSession session;
  const auto block_bytes =
      static_cast<std::size_t>(info_.blocks.width * info_.blocks.height *
                               GDALGetDataTypeSizeBytes(band.GetRasterDataType()));
  const std::int64_t first = covered.row0 / info_.blocks.height;
  const std::int64_t count = blocks_for(covered.height, info_.blocks.height);
  for (std::int64_t k = 0; k < count; ++k) {
    std::uint8_t* const into =
        bytes.subspan(static_cast<std::size_t>(k) * block_bytes, block_bytes).data();
    const CPLErr result = band.ReadBlock(static_cast<int>(covered.column0 / info_.blocks.width),
                                         static_cast<int>(first + k), into);
    if (result == CE_None) continue;
    const std::int64_t row0 = (first + k) * info_.blocks.height;
    refuse(info_,
           {.column0 = covered.column0,
            .row0 = row0,
            .width = covered.width,
            .height = std::min(info_.blocks.height, info_.height - row0)},
           session);
  }
}

// Values first, then the mask's; both in rows of cached_width.
void RasterReader::decode(std::int64_t column, std::int64_t row,
                          std::span<std::uint8_t> bytes) const {
  const PixelWindow covered = covered_by(column, row);
  const auto pixels =
      static_cast<std::size_t>(info_.blocks.cached_width * info_.blocks.cached_height);
  const std::span<std::uint8_t> values =
      bytes.first(pixels * static_cast<std::size_t>(kind_.value_bytes));
  if (kind_.goes_round_gdal_cache) {
    decode_file_blocks(band_, covered, values);
  } else {
    raster_io(band_, covered, kind_.type, values.data(),
              info_.blocks.cached_width * kind_.value_bytes);
  }
  if (mask_ == nullptr) return;
  const std::span<std::uint8_t> mask = bytes.subspan(values.size(), pixels);
  if (kind_.goes_round_gdal_cache && kind_.mask_is_shaped_alike) {
    decode_file_blocks(*mask_, covered, mask);
  } else {
    raster_io(*mask_, covered, GDT_Byte, mask.data(), info_.blocks.cached_width);
  }
}

void RasterReader::copy_values(const std::uint8_t* from, double* to, std::int64_t count) const {
  GDALCopyWords64(from, static_cast<GDALDataType>(kind_.type), static_cast<int>(kind_.value_bytes),
                  to, GDT_Float64, static_cast<int>(sizeof(double)), count);
}

// A block may be a whole raster: a piece at a time.
void RasterReader::show(std::int64_t block, const PixelWindow& covered,
                        std::span<const std::uint8_t> bytes) const {
  const std::uint8_t* const mask =
      mask_ == nullptr ? nullptr
                       : bytes.data() + info_.blocks.cached_width * info_.blocks.cached_height *
                                            kind_.value_bytes;
  std::vector<double> values;
  for (std::int64_t r = 0; r < covered.height; ++r) {
    for (std::int64_t c = 0; c < covered.width; c += kFewPixels) {
      const std::int64_t first = r * info_.blocks.cached_width + c;
      values.resize(static_cast<std::size_t>(std::min(kFewPixels, covered.width - c)));
      const auto count = static_cast<std::int64_t>(values.size());
      copy_values(bytes.data() + first * kind_.value_bytes, values.data(), count);
      for (std::int64_t k = 0; mask != nullptr && k < count; ++k) {
        if (mask[first + k] == 0) values[static_cast<std::size_t>(k)] = kNaN;
      }
      watcher_->see(values);
    }
  }
  watcher_->done(block, *this);
}

void RasterReader::read_block(std::int64_t column, std::int64_t row, const PixelWindow& window,
                              std::span<double> values, std::span<std::uint8_t> mask) const {
  const PixelWindow covered = covered_by(column, row);
  const SourceBlockCache::Request request{
      .source = source_number_,
      .index = row * blocks_for(info_.width, info_.blocks.cached_width) + column,
      .size_bytes = info_.blocks.cached_bytes,
      .file_blocks = blocks_for(covered.width, info_.blocks.width) *
                     blocks_for(covered.height, info_.blocks.height)};
  const auto bytes = cache_->get(request, [&](std::span<std::uint8_t> into) {
    decode(column, row, into);
    if (watcher_ != nullptr && watcher_->wants(request.index)) show(request.index, covered, into);
  });
  const std::int64_t first = std::max(window.column0, covered.column0);
  const std::int64_t width =
      std::min(window.column0 + window.width, covered.column0 + covered.width) - first;
  const std::int64_t end = std::min(window.row0 + window.height, covered.row0 + covered.height);
  const std::int64_t mask_start =
      info_.blocks.cached_width * info_.blocks.cached_height * kind_.value_bytes;
  for (std::int64_t r = std::max(window.row0, covered.row0); r < end; ++r) {
    const std::int64_t from =
        (r - covered.row0) * info_.blocks.cached_width + first - covered.column0;
    const std::int64_t to = (r - window.row0) * window.width + first - window.column0;
    copy_values(bytes->data() + from * kind_.value_bytes, values.data() + to, width);
    if (!mask.empty()) {
      std::copy_n(bytes->data() + mask_start + from, width, mask.data() + to);
    }
  }
}

void RasterReader::read(const PixelWindow& window, std::span<double> values,
                        std::span<std::uint8_t> mask) const {
  QMPIPE_CHECK(values.size() == window.size());
  QMPIPE_CHECK(mask.size() == (mask_ == nullptr ? 0 : window.size()));
  if (!cache_) {
    read_past_cache(window, values, mask);
    return;
  }
  const std::int64_t last_row = (window.row0 + window.height - 1) / info_.blocks.cached_height;
  const std::int64_t last_column = (window.column0 + window.width - 1) / info_.blocks.cached_width;
  for (std::int64_t row = window.row0 / info_.blocks.cached_height; row <= last_row; ++row) {
    for (std::int64_t column = window.column0 / info_.blocks.cached_width; column <= last_column;
         ++column) {
      read_block(column, row, window, values, mask);
    }
  }
}

}  // namespace qmpipe
