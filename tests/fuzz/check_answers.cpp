// A server that answers `check` with any bytes: every run ends with a report whose numbers agree, whose
// JSON is JSON, and which shows no password.
//
// The input is a list of answers in the order of the questions: a byte of flags; a byte for the status
// where the flags say so; headers, each a byte for its name, one for the length of its value, and the
// value; two bytes for the length of the body, and the body. Where the list ends nothing is there (404).
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "formats/bytes/gzip.h"
#include "formats/bytes/hash64.h"
#include "pipeline/web_check/check_url.h"
#include "scheduler/tile_key.h"

namespace {

using qmpipe::Result;
using qmpipe::web_check::HttpAnswer;
using qmpipe::web_check::HttpQuestion;

constexpr std::array kHeaderNames = {"content-encoding",
                                     "content-type",
                                     "access-control-allow-origin",
                                     "etag",
                                     "location",
                                     "transfer-encoding",
                                     "content-length",
                                     "vary"};
constexpr std::size_t kMostTiles = 12;

enum Flag : std::size_t {
  kOtherStatus = 1,
  kNoAnswer = 2,
  kGzipped = 4,
  kCutOff = 8,
  kRedirected = 16,
};

class Server {
 public:
  explicit Server(std::span<const std::uint8_t> bytes) : rest_(bytes) {}

  Result<HttpAnswer> answer(const HttpQuestion& question) {
    ++questions_;
    HttpAnswer answer;
    answer.url = question.url;
    answer.status = 404;
    if (rest_.empty()) return answer;
    const std::size_t flags = byte();
    answer.status = (flags & kOtherStatus) != 0 ? static_cast<int>(byte()) * 4 : 200;
    for (std::size_t headers = byte() % 6; headers > 0; --headers) {
      const std::string name = kHeaderNames[byte() % kHeaderNames.size()];
      const std::span<const std::uint8_t> value = take(byte());
      answer.headers.push_back({name, std::string(value.begin(), value.end())});
    }
    std::size_t length = 256 * byte();
    length += byte();
    const std::span<const std::uint8_t> body = take(length);
    answer.body.assign(body.begin(), body.end());
    // Whoever must guess a checksum never gets behind it.
    if ((flags & kGzipped) != 0) answer.body = qmpipe::GzipCompressor(1).compress(body);
    answer.is_cut_off = (flags & kCutOff) != 0;
    answer.redirects = (flags & kRedirected) != 0 ? 1 : 0;
    if ((flags & kNoAnswer) != 0) return qmpipe::Error{"nobody answers at " + question.url};
    if (question.method == qmpipe::web_check::HttpMethod::kHead) answer.body.clear();
    if (answer.body.size() > question.limit_bytes) answer.body.resize(question.limit_bytes);
    return answer;
  }
  int questions() const { return questions_; }

 private:
  std::span<const std::uint8_t> take(std::size_t count) {
    const auto taken = rest_.first(std::min(count, rest_.size()));
    rest_ = rest_.subspan(taken.size());
    return taken;
  }
  std::size_t byte() {
    const auto taken = take(1);
    return taken.empty() ? 0 : taken[0];
  }

  std::span<const std::uint8_t> rest_;
  int questions_ = 0;
};

void demand(bool holds) {
  if (!holds) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::span<const std::uint8_t> bytes(data, size);
  // Nothing that an answer could hold by chance.
  const std::string password = "pw" + std::to_string(qmpipe::hash64(bytes, 20240229));
  Server server(bytes);
  const qmpipe::web_check::CheckReport report = qmpipe::web_check::check_url(
      "https://me:" + password + "@tiles.example/set/?key=1", {.most_tiles = kMostTiles},
      [&server](const HttpQuestion& question) { return server.answer(question); });
  demand(report.tiles_sound <= report.tiles_asked);
  demand(report.tiles_asked <= static_cast<std::int64_t>(kMostTiles));
  demand(report.deepest_zoom >= 0 && report.deepest_zoom <= qmpipe::kMaxZoom);
  // layer.json, tiles, a mirrored name for some of them, an unlisted one, HEAD.
  demand(server.questions() <= static_cast<int>(kMostTiles) + 8);
  const std::string text = text_of(report);
  const std::string json = json_of(report);
  demand(!text.empty() && nlohmann::json::accept(json));
  demand((text + json).find(password) == std::string::npos);
  return 0;
}
