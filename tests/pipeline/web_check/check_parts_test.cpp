// The parts of `qmpipe check`: addresses, kinds of findings, the sample, holes, a tile's place.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <set>

#include "pipeline/web_check/check_available.h"
#include "pipeline/web_check/check_finding.h"
#include "pipeline/web_check/check_sample.h"
#include "pipeline/web_check/check_tile_answer.h"
#include "pipeline/web_check/web_address.h"
#include "stages/surface/geodesy.h"

namespace qmpipe::web_check::check_parts_test {
namespace {

TEST(WebAddress, CredentialsAreNotShown) {
  EXPECT_EQ(without_credentials("https://user:pass@host/a"), "https://***@host/a");
  EXPECT_EQ(without_credentials("redirected to \"http://user@host:81/?q=1\""),
            "redirected to \"http://***@host:81/?q=1\"");
  EXPECT_EQ(without_credentials("https://u:p@ss@host, https://a:b@c"),
            "https://***@host, https://***@c");
  EXPECT_EQ(without_credentials("user:pass@host/terrain is no address"),
            "***@host/terrain is no address");
  EXPECT_EQ(without_credentials("//u:p@h"), "//***@h");
  for (const char* text :
       {"https://host/{z}/{x}@2x.terrain", "mail a@b.org", "", "https://host/"}) {
    EXPECT_EQ(without_credentials(text), text);
  }
}

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::MatchesRegex;

std::string resolved(const std::string& folder, const std::string& reference) {
  const Result<WebAddress> address =
      resolve(folder_of(parse_web_address(folder).value()), reference);
  return address ? address->text() : "error: " + address.error().message;
}

TEST(WebAddress, ReferencesResolveAsInABrowser) {
  EXPECT_EQ(resolved("http://h/a/b", "0/0/0.terrain"), "http://h/a/b/0/0/0.terrain");
  EXPECT_EQ(resolved("http://h/a/layer.json", "/0.terrain?v=1"), "http://h/0.terrain?v=1");
  EXPECT_EQ(resolved("https://h/a/", "//other/0"), "https://other/0");
  EXPECT_EQ(resolved("https://h/a/", "http://other:81/0#x"), "http://other:81/0");
  EXPECT_EQ(resolved("http://h", "x?y=z:1"), "http://h/x?y=z:1");
}

TEST(WebAddress, AFoldersQueryIsKept) {
  EXPECT_EQ(resolved("http://h/a/layer.json?key=1", "0"), "http://h/a/0?key=1");
  EXPECT_EQ(resolved("http://h/a?key=1", "0?v=2"), "http://h/a/0?v=2&key=1");
}

TEST(WebAddress, OtherSchemesAreRefused) {
  for (const char* reference : {"s3://bucket/0", "data:,x", "file:///x", "http:/x", "a b"}) {
    EXPECT_EQ(resolved("http://h/a", reference).substr(0, 6), "error:") << reference;
  }
}

TEST(WebAddress, OriginsLeaveOutTheSchemesOwnPort) {
  EXPECT_EQ(parse_web_address("HTTPS://User@Host:443/x").value().origin(), "https://host");
  EXPECT_EQ(parse_web_address("http://host:443").value().origin(), "http://host:443");
  EXPECT_EQ(parse_web_address("http://[::1]:80/").value().origin(), "http://[::1]");
}

TEST(WebAddress, TemplatesAreFilledAsCesiumJsDoes) {
  const TemplateValues values = {.key = {.zoom = 3, .x = 14, .y = 5}, .version = "1 b/c"};
  EXPECT_EQ(fill_template("{z}/{x}/{y}.terrain?v={version}", values), "3/14/5.terrain?v=1%20b%2Fc");
  EXPECT_EQ(fill_template("{y}{y}{-y}", values), "55%7B-y%7D");
  EXPECT_EQ(fill_template("{z}{", values), "3%7B");
  EXPECT_EQ(fill_template("{version}", {.key = {}, .version = ""}), "%7Bversion%7D");
}

TEST(CheckKinds, EachHasAnUnchangingNameAndAdvice) {
  std::set<std::string> names;
  for (std::size_t k = 0; k < kCheckKinds; ++k) {
    const CheckKindText& text = text_of(static_cast<CheckKind>(k));
    EXPECT_EQ(static_cast<std::size_t>(text.kind), k) << text.name;
    EXPECT_THAT(text.name, MatchesRegex("[a-z0-9]+(-[a-z0-9]+)*"));
    EXPECT_TRUE(names.insert(text.name).second) << text.name;
    EXPECT_FALSE(std::string(text.viewer).ends_with('.')) << text.name;
    EXPECT_TRUE(std::string(text.remedy).ends_with('.') || std::string(text.remedy).ends_with(')'))
        << text.name;
  }
}

TEST(CheckLog, CountsTilesThatSufferAlikeAndKeepsFaultsFirst) {
  CheckLog log;
  log.add(CheckKind::kNoCaching, CheckSubject::kTile, "a", "x");
  log.add(CheckKind::kTileMissing, CheckSubject::kTile, "b", "404");
  log.add(CheckKind::kTileMissing, CheckSubject::kTile, "c", "403");
  log.add(CheckKind::kMisspeltKey, CheckSubject::kLayer, "l", "one");
  log.add(CheckKind::kMisspeltKey, CheckSubject::kLayer, "l", "two");
  const std::vector<CheckFinding> findings = log.sorted();
  ASSERT_EQ(findings.size(), 4U);
  EXPECT_EQ(findings[0].kind, CheckKind::kTileMissing);
  EXPECT_EQ(findings[0].count, 2);
  EXPECT_EQ(findings[0].url, "b");
  EXPECT_EQ(findings[2].text, "two");
  EXPECT_EQ(findings[3].kind, CheckKind::kNoCaching);
  EXPECT_EQ(log.faulty_answers(), 2);
}

TEST(Sample, HasRootsThenTheMiddleOfEachZoomThenCorners) {
  const std::vector<TileKey> roots = TilingScheme(Projection::kGeodetic).roots();
  const std::vector<std::vector<TileRange>> available = {
      {{0, 0, 1, 0}}, {{0, 0, 3, 1}}, {{0, 0, 7, 3}}};
  EXPECT_EQ(sample_tiles(available, roots, 2), roots);
  EXPECT_THAT(sample_tiles(available, roots, 4),
              ElementsAre(roots[0], roots[1], TileKey{1, 1, 0}, TileKey{2, 3, 1}));
  EXPECT_THAT(telling_tiles(available[2], 2),
              ElementsAre(TileKey{2, 3, 1}, TileKey{2, 0, 0}, TileKey{2, 7, 3}, TileKey{2, 0, 3},
                          TileKey{2, 7, 0}));
}

TEST(Sample, IsListedWithoutRepetitionsAndAsLargeAsCanBe) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    ServedLayer layer;
    std::int64_t tiles = 2;
    layer.available = {{{0, 0, 1, 0}}};
    for (std::int32_t zoom = 1; zoom < 8; ++zoom) {
      std::vector<TileRange>& ranges = layer.available.emplace_back();
      if (random() % 4 == 0) continue;
      const auto x = static_cast<std::int32_t>(random() % 2);
      const auto width = static_cast<std::int32_t>(random() % (1U << zoom));
      ranges.push_back({x, 0, x + width, 0});
      tiles += width + 1;
    }
    const std::size_t limit = 1 + random() % 30;
    const auto keys = sample_tiles(layer.available, layer.scheme.roots(), limit);
    EXPECT_TRUE(std::is_sorted(keys.begin(), keys.end()));
    EXPECT_EQ(std::adjacent_find(keys.begin(), keys.end()), keys.end());
    EXPECT_TRUE(std::all_of(keys.begin(), keys.end(),
                            [&](const TileKey& key) { return layer.lists(key); }));
    EXPECT_LE(keys.size(), limit);
    // Where there are many more tiles than wanted, random ones fill the sample.
    if (tiles > 8 * static_cast<std::int64_t>(limit)) {
      EXPECT_EQ(keys.size(), limit);
    }
  }
}

std::vector<TileRange> random_ranges(std::mt19937_64& random, std::int32_t columns,
                                     std::int32_t rows) {
  std::vector<TileRange> ranges(random() % 5);
  for (TileRange& range : ranges) {
    const auto part = [&random](std::int32_t end) {
      return static_cast<std::int32_t>(random() % static_cast<std::uint64_t>(end));
    };
    range.start_x = part(columns);
    range.end_x = range.start_x + part(columns - range.start_x);
    range.start_y = part(rows);
    range.end_y = range.start_y + part(rows - range.start_y);
  }
  return ranges;
}

TEST(Holes, AreFoundWhereTrialTileByTileFindsThem) {
  int with_hole = 0;
  for (std::uint64_t seed = 1; seed <= 2000; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    ServedLayer layer;
    layer.available = {{}, {}, random_ranges(random, 8, 4), random_ranges(random, 16, 8)};
    std::set<TileKey> holes;
    for (std::int32_t y = 0; y < 8; ++y) {
      for (std::int32_t x = 0; x < 16; ++x) {
        const TileKey child = {.zoom = 3, .x = x, .y = y};
        if (layer.lists(child) && !layer.lists(parent_of(child))) holes.insert(parent_of(child));
      }
    }
    const auto hole = unlisted_parent(layer.available[3], layer.available[2], 3);
    ASSERT_EQ(hole.has_value(), !holes.empty());
    if (hole) {
      ++with_hole;
      EXPECT_TRUE(holes.contains(*hole)) << to_string(*hole);
    }
  }
  EXPECT_GT(with_hole, 200);
  EXPECT_LT(with_hole, 1800);
}

// As a tile's header has it: around its corners, middle and side middles, somewhat off.
QuantizedMeshHeader header_at(const RectangleDeg& rectangle) {
  std::vector<Vec3> points;
  for (const double s : {0.0, 0.5, 1.0}) {
    for (const double t : {0.0, 0.5, 1.0}) {
      points.push_back(to_ecef({std::lerp(rectangle.west_deg, rectangle.east_deg, s),
                                std::lerp(rectangle.south_deg, rectangle.north_deg, t), 900}));
    }
  }
  QuantizedMeshHeader header;
  header.min_height_m = -100;
  header.max_height_m = 4000;
  const Sphere sphere = bounding_sphere(points);
  header.sphere_centre_ecef_m = sphere.centre;
  header.sphere_radius_m = sphere.radius_m;
  return header;
}

TEST(Place, OfEveryTileIsItsOwnAndNotItsMirrorsOrOneFarAway) {
  for (const Projection projection : {Projection::kGeodetic, Projection::kMercator}) {
    const TilingScheme scheme(projection);
    // Tiles that reach around half of the globe are not told apart.
    const std::int32_t first_zoom = projection == Projection::kGeodetic ? 1 : 2;
    for (std::int32_t zoom = first_zoom; zoom <= 6; ++zoom) {
      for (std::int32_t y = 0; y < scheme.rows(zoom); ++y) {
        for (std::int32_t x = 0; x < scheme.columns(zoom); x += 3) {
          const TileKey key = {.zoom = zoom, .x = x, .y = y};
          SCOPED_TRACE(to_string(key));
          const QuantizedMeshHeader header = header_at(scheme.rectangle_deg(key));
          ASSERT_EQ(place_of_tile(scheme, key, header), Whereabouts::kHere);
          ASSERT_EQ(place_of_tile(scheme, mirrored(scheme, key), header),
                    Whereabouts::kMirroredRow);
          const TileKey far = {
              .zoom = zoom, .x = (x + scheme.columns(zoom) / 2) % scheme.columns(zoom), .y = y};
          const bool is_near_pole = y < 2 || y + 2 >= scheme.rows(zoom);
          if (!is_near_pole) {
            ASSERT_EQ(place_of_tile(scheme, far, header), Whereabouts::kElsewhere);
          }
        }
      }
    }
  }
}

TEST(Place, OfAHeaderWithoutNumbersIsElsewhere) {
  const TilingScheme scheme(Projection::kGeodetic);
  QuantizedMeshHeader header;
  header.sphere_centre_ecef_m = {std::nan(""), 0, 0};
  EXPECT_EQ(place_of_tile(scheme, {.zoom = 3, .x = 2, .y = 5}, header), Whereabouts::kElsewhere);
  header.max_height_m = std::numeric_limits<float>::infinity();
  EXPECT_EQ(place_of_tile(scheme, {.zoom = 3, .x = 2, .y = 5}, header), Whereabouts::kElsewhere);
}

}  // namespace
}  // namespace qmpipe::web_check::check_parts_test
