#include "tools/web/detail_service.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <nlohmann/json.hpp>
#include <span>
#include <string_view>

#include "formats/bytes/gzip.h"
#include "formats/bytes/hash64.h"
#include "formats/detail_model/arrays.h"

namespace qmpipe::web {
namespace {

using Json = nlohmann::ordered_json;

// Smaller ones by more cost seconds on large models and win a few per cent.
constexpr int kGzipLevel = 6;
constexpr std::string_view kBlockFolder = "block/";
constexpr std::string_view kBinaryExtension = ".bin";

void add_planes(std::span<const std::uint32_t> words, std::vector<std::uint8_t>& bytes) {
  for (std::uint32_t shift = 0; shift < 32; shift += 8) {
    for (const std::uint32_t word : words) {
      bytes.push_back(static_cast<std::uint8_t>(word >> shift));
    }
  }
}

Json box_of(const DetailBlock& block, const DetailFrame& frame) {
  if (block.points.empty()) return nullptr;
  DetailPoint low = block.points.front();
  DetailPoint high = low;
  for (const DetailPoint& point : block.points) {
    low = {std::min(low.x, point.x), std::min(low.y, point.y), std::min(low.z, point.z)};
    high = {std::max(high.x, point.x), std::max(high.y, point.y), std::max(high.z, point.z)};
  }
  return {frame.place(low), frame.place(high)};
}

// "7" of "block/7.bin"; numbers have one name each.
std::optional<std::size_t> block_number(std::string_view path) {
  path.remove_prefix(kBlockFolder.size());
  if (!path.ends_with(kBinaryExtension)) return std::nullopt;
  path.remove_suffix(kBinaryExtension.size());
  std::size_t number = 0;
  const auto [end, error] = std::from_chars(path.data(), path.data() + path.size(), number);
  if (error != std::errc() || std::to_string(number) != path) return std::nullopt;
  return number;
}

}  // namespace

DetailService::DetailService(const DetailModel& model, const std::string& name) {
  const DetailArrays arrays = encode_detail(model);
  std::array<std::size_t, kDetailArrayCount> taken{};
  GzipCompressor compressor(kGzipLevel);
  const auto pack = [&](const DetailSummary& part, DetailArray first, DetailArray last) {
    const auto lengths = array_lengths(part);
    std::vector<std::uint8_t> plain;
    for (std::size_t k = index_of(first); k <= index_of(last); ++k) {
      add_planes(std::span(arrays[k]).subspan(taken[k], lengths[k]), plain);
      taken[k] += lengths[k];
    }
    std::vector<std::uint8_t> packed = compressor.compress(plain);
    std::string etag = etag_of(packed);
    return Part{.packed = std::move(packed), .plain_bytes = plain.size(), .etag = std::move(etag)};
  };
  const DetailSummary whole = summary_of(model);
  DetailSummary one;
  for (const DetailBlockSize& size : whole.blocks) {
    one.blocks = {size};
    blocks_.push_back(pack(one, DetailArray::kPointX, DetailArray::kSvo));
  }
  seams_ = pack(whole, DetailArray::kSeamBlock, DetailArray::kSeamPoint);
  coarsest_triangles_ = finest_triangles_ = model.seams.size();
  for (const DetailBlock& block : model.blocks) {
    coarsest_triangles_ += block.triangles_at(0);
    finest_triangles_ += block.triangles_at(block.levels());
  }
  description_ = describe(model, name);
  description_etag_ =
      etag_of({reinterpret_cast<const std::uint8_t*>(description_.data()), description_.size()});
}

std::string DetailService::describe(const DetailModel& model, const std::string& name) const {
  Json blocks = Json::array();
  for (std::size_t b = 0; b < model.blocks.size(); ++b) {
    const DetailBlock& block = model.blocks[b];
    blocks.push_back({{"points", block.points.size()},
                      {"coarse_points", block.coarse_points()},
                      {"coarse_triangles", block.triangles_at(0)},
                      {"levels", block.levels()},
                      {"box", box_of(block, model.frame)},
                      {"svo_m", {block.svo_m.front(), block.svo_m.back()}},
                      {"bytes", blocks_[b].packed.size()}});
  }
  const Json document = {{"name", name},
                         {"crs", model.crs_wkt},
                         {"interval", model.interval},
                         {"offset", model.frame.offset},
                         {"step_m", model.frame.step_m},
                         {"triangles", {coarsest_triangles_, finest_triangles_}},
                         {"seams", model.seams.size()},
                         {"blocks", std::move(blocks)}};
  return document.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::optional<HttpReply> DetailService::answer(const HttpRequest& request) const {
  std::string_view path = request.path;
  if (!path.starts_with('/')) return std::nullopt;
  path.remove_prefix(1);
  if (path == "model.json") {
    HttpReply reply = cached_reply(request, "application/json", description_, description_etag_);
    reply.headers.emplace_back("Cache-Control", "no-cache");
    return reply;
  }
  if (path == "seams.bin") return answer_part(request, seams_);
  if (!path.starts_with(kBlockFolder)) return std::nullopt;
  const std::optional<std::size_t> number = block_number(path);
  if (!number || *number >= blocks_.size()) {
    return error_reply(404, fmt::format("{} is no block: ask for block/0.bin to block/{}.bin", path,
                                        blocks_.size() - 1));
  }
  return answer_part(request, blocks_[*number]);
}

HttpReply DetailService::answer_part(const HttpRequest& request, const Part& part) {
  const bool stays_packed = accepts_gzip(request.accept_encoding);
  const std::string etag = stays_packed ? part.etag : part.etag + "-plain";
  HttpReply reply = cached_reply(request, "application/octet-stream", {}, etag);
  reply.headers.emplace_back("Cache-Control", "no-cache");
  if (reply.status != 200) return reply;
  if (stays_packed) {
    reply.body.assign(part.packed.begin(), part.packed.end());
    reply.headers.emplace_back("Content-Encoding", "gzip");
    return reply;
  }
  const auto plain = gzip_decompress(part.packed, part.plain_bytes);
  if (!plain) return error_reply(500, plain.error().message);
  reply.body.assign(plain->begin(), plain->end());
  return reply;
}

}  // namespace qmpipe::web
