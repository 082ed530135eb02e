// `qmpipe check` on hand-made answers, without a server: what depends on addresses, on many answers
// together, and on answers that no server would think of. Faults of real servers:
// check_server_test.py.
#include "pipeline/web_check/check_url.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <functional>
#include <map>
#include <random>
#include <set>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"
#include "formats/bytes/gzip.h"
#include "formats/tile/tile_path.h"
#include "pipeline/web_check/check_available.h"
#include "pipeline/web_check/web_address.h"
#include "tests/support/verify_fixture.h"

namespace qmpipe::web_check::check_url_test {
namespace {

using qmpipe::testing::SetFixture;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr const char* kUrl = "https://tiles.example/set/";

// Serves a folder as docs/SERVING.md asks for; `change` sees every answer.
class Served {
 public:
  explicit Served(const SetFixture& set) : set_(set) {}

  std::function<void(const HttpQuestion&, HttpAnswer&)> change = [](const auto&, auto&) {};
  std::vector<std::string> asked;

  Result<HttpAnswer> answer(const HttpQuestion& request) {
    asked.push_back(request.url);
    const WebAddress address = parse_web_address(request.url).value();
    HttpAnswer answer = {.status = 404, .url = request.url, .headers = {}, .body = {}};
    const std::string name = address.path.substr(std::string("/set/").size());
    const auto bytes = read_file_bytes(set_.path() / name, kLargestTileBytes);
    if (bytes) {
      answer.status = 200;
      answer.headers = {{"access-control-allow-origin", "*"}, {"etag", "\"1\""}};
      if (name.ends_with(kTileExtension)) {
        answer.headers.push_back({"content-type", "application/vnd.quantized-mesh"});
        answer.headers.push_back({"content-encoding", "gzip"});
      }
      if (request.method == HttpMethod::kGet) answer.body = *bytes;
    }
    change(request, answer);
    return answer;
  }

  CheckReport check(const std::string& url = kUrl, const CheckOptions& options = {}) {
    return check_url(url, options, [this](const HttpQuestion& r) { return answer(r); });
  }

 private:
  const SetFixture& set_;
};

std::vector<std::string> codes(const CheckReport& report, CheckSeverity severity) {
  std::vector<std::string> names;
  for (const CheckFinding& finding : report.findings) {
    if (finding.severity == severity) names.emplace_back(text_of(finding.kind).name);
  }
  return names;
}

const SetFixture& sound_set() {
  static const SetFixture set(testing::sixteen_tiles());
  return set;
}

TEST(CheckUrl, FindsNothingInASoundSet) {
  const CheckReport report = Served(sound_set()).check();
  EXPECT_THAT(report.findings, IsEmpty()) << text_of(report);
  EXPECT_EQ(report.tiles_asked, 16);
  EXPECT_EQ(report.tiles_sound, 16);
  EXPECT_EQ(report.deepest_zoom, 3);
}

TEST(CheckUrl, AsksTheSameTilesEachTime) {
  Served first(sound_set());
  Served second(sound_set());
  first.check(kUrl, {.most_tiles = 7});
  second.check(kUrl, {.most_tiles = 7});
  EXPECT_EQ(first.asked, second.asked);
  // layer.json, 7 tiles, an unlisted one, and HEAD.
  EXPECT_EQ(first.asked.size(), 10U);
}

TEST(CheckUrl, HttpIsAHintUntilAPageOverHttpsIsNamed) {
  const std::string url = "http://tiles.example/set/";
  const CheckReport plain = Served(sound_set()).check(url);
  EXPECT_THAT(codes(plain, CheckSeverity::kHint), ElementsAre("http-only"));
  EXPECT_EQ(plain.count(CheckSeverity::kFault), 0);
  const CheckReport mixed = Served(sound_set()).check(url, {.origin = "https://page.example"});
  EXPECT_THAT(codes(mixed, CheckSeverity::kFault), ElementsAre("mixed-content"));
  const CheckReport alike = Served(sound_set()).check(url, {.origin = "http://page.example"});
  EXPECT_THAT(alike.findings, IsEmpty());
}

TEST(CheckUrl, BrowsersTrustTheirOwnMachineWithoutHttps) {
  for (const char* host : {"localhost:8080", "127.0.0.1", "[::1]:8080", "a.localhost"}) {
    const CheckReport report =
        Served(sound_set())
            .check("http://" + std::string(host) + "/set/", {.origin = "https://page.example"});
    EXPECT_THAT(report.findings, IsEmpty()) << host;
  }
}

TEST(CheckUrl, TilesOverHttpInALayerOverHttpsAreMixedContent) {
  const SetFixture set(testing::sixteen_tiles());
  set.change_layer(
      [](LayerJson& layer) { layer.tile_urls = {"http://tiles.example/set/{z}/{x}/{y}.terrain"}; });
  EXPECT_THAT(codes(Served(set).check(), CheckSeverity::kFault), ElementsAre("mixed-content"));
}

TEST(CheckUrl, LayerAndFolderAreTheSameAddress) {
  for (const char* url : {"https://tiles.example/set", "https://tiles.example/set/layer.json",
                          "HTTPS://Tiles.example/set/#part"}) {
    const CheckReport report = Served(sound_set()).check(url);
    EXPECT_EQ(report.layer_url, "https://tiles.example/set/layer.json");
    EXPECT_THAT(report.findings, IsEmpty());
  }
}

TEST(CheckUrl, RefusesWhatIsNoWebAddress) {
  for (const char* url : {"", "out", "/srv/out", "file:///srv/out", "http://", "https:///x",
                          "http://h/a b", "http://h/\x01"}) {
    EXPECT_THROW(Served(sound_set()).check(url), UsageError) << url;
  }
  EXPECT_THROW(Served(sound_set()).check(kUrl, {.origin = "page"}), UsageError);
}

TEST(CheckUrl, GivesUpOnAServerThatLeavesTilesWithoutAnswer) {
  int asked = 0;
  Served served(sound_set());
  const CheckReport report =
      check_url(kUrl, {}, [&](const HttpQuestion& request) -> Result<HttpAnswer> {
        if (request.url.ends_with("layer.json")) return served.answer(request);
        ++asked;
        return Error{"nobody there"};
      });
  EXPECT_EQ(asked, 3);
  EXPECT_TRUE(report.is_answered);
  EXPECT_EQ(report.tiles_sound, 0);
  EXPECT_THAT(codes(report, CheckSeverity::kFault), ElementsAre("tile-no-answer"));
}

TEST(CheckUrl, TilesThatBeginLikeGzipByChanceAreTiles) {
  const SetFixture set(testing::sixteen_tiles());
  // The lowest two bytes of the header's first number, which clients do not read.
  set.change(testing::kLeaf, [](QuantizedMesh& mesh) {
    auto bits = std::bit_cast<std::uint64_t>(mesh.header.centre_ecef_m[0]);
    bits = (bits & ~std::uint64_t{0xFFFFFFFF}) | 0x01018B1FU;
    mesh.header.centre_ecef_m[0] = std::bit_cast<double>(bits);
  });
  const CheckReport report = Served(set).check();
  EXPECT_THAT(report.findings, IsEmpty()) << text_of(report);
}

TEST(CheckUrl, LooksForHolesInManyRangesAtTheSampleOnly) {
  const SetFixture set(testing::sixteen_tiles());
  set.change_layer([](LayerJson& layer) {
    std::vector<TileRange>& ranges = layer.available[3];
    ranges.resize(kMostRangesCompared, ranges.front());
  });
  const CheckReport whole = Served(set).check();
  EXPECT_THAT(codes(whole, CheckSeverity::kHint), ElementsAre("many-ranges"));
  EXPECT_EQ(whole.count(CheckSeverity::kFault), 0);
  set.unlist(testing::kLeafParent);
  EXPECT_THAT(codes(Served(set).check(), CheckSeverity::kFault), ElementsAre("available-hole"));
}

TEST(CheckUrl, DeepZoomsAreToldAndLeftAlone) {
  const SetFixture set(testing::sixteen_tiles());
  set.change_layer([](LayerJson& layer) {
    layer.available.resize(28);
    layer.available[27].push_back({5, 5, 5, 5});
    layer.max_zoom = 27;
  });
  const CheckReport report = Served(set).check();
  EXPECT_THAT(codes(report, CheckSeverity::kHint), ElementsAre("deeper-not-checked"));
  EXPECT_EQ(report.tiles_sound, 16);
}

TEST(CheckUrl, EveryTruncationOfLayerJsonIsAFault) {
  const auto bytes = read_file_bytes(sound_set().path() / "layer.json", kLargestTileBytes);
  // Without the closing brace and what follows it.
  for (std::size_t size = 0; size + 2 < bytes->size(); ++size) {
    Served served(sound_set());
    served.change = [size](const HttpQuestion& request, HttpAnswer& answer) {
      if (request.url.ends_with("layer.json")) answer.body.resize(size);
    };
    ASSERT_GT(served.check().count(CheckSeverity::kFault), 0) << size;
  }
}

// Bytes of headers and bodies overwritten at random, here and there.
void damage(HttpAnswer& answer, std::mt19937_64& random) {
  const auto below = [&random](std::size_t end) { return random() % end; };
  if (below(3) == 0) return;
  if (below(12) == 0) answer.status = static_cast<int>(below(600));
  if (below(12) == 0 && !answer.headers.empty()) {
    answer.headers.erase(answer.headers.begin() +
                         static_cast<std::ptrdiff_t>(below(answer.headers.size())));
  }
  if (below(12) == 0) answer.headers.push_back({"content-encoding", "gzip, ,identity,GZIP"});
  if (below(12) == 0) answer.is_cut_off = true;
  if (below(12) == 0) answer.redirects = 3;
  if (below(12) == 0) answer.url = "\xFF no address";
  if (below(4) == 0) answer.body.resize(below(answer.body.size() + 1));
  for (std::size_t k = below(6); k > 0 && !answer.body.empty(); --k) {
    answer.body[below(answer.body.size())] = static_cast<std::uint8_t>(below(256));
  }
}

TEST(CheckUrl, EndsWithAReportWhateverTheAnswersHold) {
  for (std::uint64_t seed = 1; seed <= 400; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    Served served(sound_set());
    served.change = [&random](const HttpQuestion& request, HttpAnswer& answer) {
      // Plain bytes, so that damage gets past gzip's check sum.
      const auto plain = plain_tile_bytes(answer.body);
      if (plain && random() % 2 == 0) answer.body = *plain;
      // layer.json more rarely, or tiles are seldom asked for.
      if (!request.url.ends_with("layer.json") || random() % 4 == 0) damage(answer, random);
    };
    const CheckReport report = served.check();
    ASSERT_LE(report.tiles_sound, report.tiles_asked);
    ASSERT_FALSE(text_of(report).empty());
    ASSERT_EQ(json_of(report).front(), '{');
  }
}

}  // namespace
}  // namespace qmpipe::web_check::check_url_test
