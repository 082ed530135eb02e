// What a web server answers to a request for a part of a detail-increment model: without sockets, as
// tools/web/tile_service.h.
//
// Addresses, below /:
//   model.json    what the page shows and needs to read the rest: name, crs, interval, the frame's
//                 offset and step_m; triangles at the coarsest and finest levels; seams, a count; of
//                 each block points, coarse_points, coarse_triangles, levels, its box in the frame's
//                 coordinates or null, svo_m of its coarsest and finest level, bytes of its gzipped part
//   block/N.bin   application/octet-stream: the arrays point_x to svo of block N, counted from 0
//   seams.bin     the arrays seam_block and seam_point
// Arrays are those of the model's file (docs/DETAIL_FORMAT.md), one after the other without gaps; of
// each the lowest bytes of all words come first, then the next ones, and so on. Both are sent with
// Content-Encoding: gzip, plain where the client takes no gzip. All answers have an ETag.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "formats/detail_model/data.h"
#include "tools/web/tile_service.h"

namespace qmpipe::web {

// const use is safe from several threads.
class DetailService {
 public:
  // Packs all parts: they are in memory from then on, the model is not needed any more. REQUIRES: a
  // model as read_detail_file() gives it.
  DetailService(const DetailModel& model, const std::string& name);

  // Nothing when the path names no part of a model.
  std::optional<HttpReply> answer(const HttpRequest& request) const;

  std::size_t blocks() const { return blocks_.size(); }
  std::uint64_t coarsest_triangles() const { return coarsest_triangles_; }
  std::uint64_t finest_triangles() const { return finest_triangles_; }

 private:
  struct Part {
    std::vector<std::uint8_t> packed;
    std::size_t plain_bytes = 0;
    std::string etag;
  };
  static HttpReply answer_part(const HttpRequest& request, const Part& part);
  std::string describe(const DetailModel& model, const std::string& name) const;

  std::vector<Part> blocks_;
  Part seams_;
  std::uint64_t coarsest_triangles_ = 0;
  std::uint64_t finest_triangles_ = 0;
  std::string description_;  // model.json
  std::string description_etag_;
};

}  // namespace qmpipe::web
