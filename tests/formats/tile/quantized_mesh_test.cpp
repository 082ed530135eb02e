#include "formats/tile/quantized_mesh.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "formats/tile/oct_normal.h"
#include "tests/support/independent_reader.h"
#include "tests/support/random_mesh.h"

namespace qmpipe::quantized_mesh_test {
namespace {

using testing::equal_bits;
using testing::Extensions;
using ::testing::HasSubstr;
using testing::random_mesh;

using Bytes = std::vector<std::uint8_t>;

void put_u32(Bytes& bytes, std::size_t at, std::uint32_t value) {
  for (std::size_t i = 0; i < 4; ++i) bytes[at + i] = static_cast<std::uint8_t>(value >> (8 * i));
}

void append_extension(Bytes& bytes, std::uint8_t id, const Bytes& body) {
  bytes.push_back(id);
  bytes.resize(bytes.size() + 4);
  put_u32(bytes, bytes.size() - 4, static_cast<std::uint32_t>(body.size()));
  bytes.insert(bytes.end(), body.begin(), body.end());
}

// Four corners, two triangles: 92 + 24 bytes of vertices, then the triangle count at 116.
QuantizedMesh square() {
  QuantizedMesh mesh = testing::grid_mesh(2);
  mesh.h = {0, 100, 50, 32767};
  return mesh;
}

std::string fault_of(const Bytes& bytes) {
  const auto decoded = decode(bytes);
  return decoded.ok() ? "decoded" : decoded.error().message;
}

TEST(QuantizedMesh, EncodeThenDecodeIsTheIdentity) {
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const QuantizedMesh mesh = random_mesh(random, 1 + random() % 400, Extensions::kRandom);
    const auto decoded = decode(encode(mesh));
    ASSERT_TRUE(decoded.ok()) << decoded.error().message;
    ASSERT_TRUE(equal_bits(*decoded, mesh));
  }
}

void expect_agreement(const QuantizedMesh& mesh) {
  const independent::Tile tile = independent::read_tile(encode(mesh));
  const QuantizedMeshHeader& header = mesh.header;
  std::vector<double> doubles(header.centre_ecef_m.begin(), header.centre_ecef_m.end());
  doubles.insert(doubles.end(), header.sphere_centre_ecef_m.begin(),
                 header.sphere_centre_ecef_m.end());
  doubles.push_back(header.sphere_radius_m);
  doubles.insert(doubles.end(), header.horizon_occlusion_point.begin(),
                 header.horizon_occlusion_point.end());
  EXPECT_EQ(tile.header_doubles, doubles);
  EXPECT_EQ(tile.minimum_height, header.min_height_m);
  EXPECT_EQ(tile.maximum_height, header.max_height_m);
  EXPECT_EQ(tile.u, std::vector<int>(mesh.u.begin(), mesh.u.end()));
  EXPECT_EQ(tile.v, std::vector<int>(mesh.v.begin(), mesh.v.end()));
  EXPECT_EQ(tile.height, std::vector<int>(mesh.h.begin(), mesh.h.end()));
  EXPECT_EQ(tile.triangles, mesh.indices);
  EXPECT_EQ(tile.west, mesh.sides[0]);
  EXPECT_EQ(tile.south, mesh.sides[1]);
  EXPECT_EQ(tile.east, mesh.sides[2]);
  EXPECT_EQ(tile.north, mesh.sides[3]);
  std::size_t count = 0;
  for (const independent::Tile::Extension& extension : tile.extensions) {
    ++count;
    if (extension.id == 1) {
      EXPECT_EQ(extension.bytes.size(), 2 * mesh.normals.size());
    }
    if (extension.id == 2) {
      EXPECT_EQ(extension.bytes.size(), mesh.water_mask.size());
    }
    if (extension.id == 4) {
      EXPECT_EQ(extension.bytes.substr(4), mesh.metadata_json);
    }
  }
  EXPECT_EQ(count, (mesh.normals.empty() ? 0U : 1U) + (mesh.water_mask.empty() ? 0U : 1U) +
                       (mesh.metadata_json ? 1U : 0U));
}

TEST(QuantizedMesh, AReaderWrittenFromTheSpecificationAgrees) {
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    expect_agreement(random_mesh(random, 1 + random() % 400, Extensions::kRandom));
  }
  std::mt19937_64 random(7);
  expect_agreement(random_mesh(random, 65537, Extensions::kRandom));
  expect_agreement(random_mesh(random, 70000, Extensions::kNone));
}

TEST(QuantizedMesh, TheBytesOfAKnownTileStayAsTheyAre) {
  const Bytes bytes = encode(square());
  const Bytes body(bytes.begin() + 88, bytes.end());
  const Bytes expected = {4, 0, 0,    0,                             // vertices
                          0, 0, 0xFE, 0xFF, 0xFD, 0xFF, 0xFE, 0xFF,  // u: 0, 32767, 0, 32767
                          0, 0, 0,    0,    0xFE, 0xFF, 0,    0,     // v: 0, 0, 32767, 32767
                          0, 0, 200,  0,    99,   0,    0x9A, 0xFF,  // h: 0, 100, 50, 32767
                          2, 0, 0,    0,                             // triangles
                          0, 0, 0,    0,    0,    0,                 // 0, 1, 2
                          1, 0, 2,    0,    0,    0,                 // 2, 1, 3
                          2, 0, 0,    0,    0,    0,    2,    0,     // west 0, 2
                          2, 0, 0,    0,    0,    0,    1,    0,     // south 0, 1
                          2, 0, 0,    0,    1,    0,    3,    0,     // east 1, 3
                          2, 0, 0,    0,    2,    0,    3,    0};    // north 2, 3
  EXPECT_EQ(body, expected);
  // 10 and 20 as float32, at their places.
  EXPECT_EQ(Bytes(bytes.begin() + 24, bytes.begin() + 32),
            (Bytes{0, 0, 0x20, 0x41, 0, 0, 0xA0, 0x41}));
}

TEST(QuantizedMesh, IndicesHave16BitsUpTo65535VerticesAnd32From65537) {
  std::mt19937_64 random(3);
  for (const auto& [vertices, width] :
       {std::pair<std::size_t, std::size_t>{65535, 2}, {65537, 4}}) {
    const QuantizedMesh mesh = random_mesh(random, vertices, Extensions::kNone);
    std::size_t expected = 92 + 6 * vertices;
    expected += (width - expected % width) % width;
    expected += 4 + width * mesh.indices.size();
    for (const auto& side : mesh.sides) expected += 4 + width * side.size();
    const Bytes bytes = encode(mesh);
    EXPECT_EQ(bytes.size(), expected) << vertices;
    const auto decoded = decode(bytes);
    ASSERT_TRUE(decoded.ok()) << decoded.error().message;
    EXPECT_TRUE(equal_bits(*decoded, mesh));
  }
}

TEST(QuantizedMesh, Exactly65536VerticesAreRefusedBothWays) {
  std::mt19937_64 random(3);
  EXPECT_THROW(encode(random_mesh(random, 65536, Extensions::kNone)), InternalError);
  Bytes bytes = encode(random_mesh(random, 65537, Extensions::kNone));
  put_u32(bytes, 88, 65536);
  EXPECT_THAT(fault_of(bytes), HasSubstr("exactly 65536 vertices"));
}

TEST(QuantizedMesh, PaddingComesOnlyBefore32BitIndicesOfAnOddNumberOfVertices) {
  std::mt19937_64 random(5);
  for (const std::size_t vertices : {3U, 4U, 65535U, 65537U, 65538U, 65539U}) {
    const QuantizedMesh mesh = random_mesh(random, vertices, Extensions::kNone);
    const Bytes bytes = encode(mesh);
    const std::size_t padding = vertices > 65536 && vertices % 2 == 1 ? 2 : 0;
    const std::size_t at = 92 + 6 * vertices + padding;
    const std::uint32_t triangles = bytes[at] + 256U * bytes[at + 1] + 65536U * bytes[at + 2];
    EXPECT_EQ(triangles, mesh.triangle_count()) << vertices;
  }
}

TEST(QuantizedMesh, EveryTruncationIsRefused) {
  std::mt19937_64 random(11);
  for (int round = 0; round < 10; ++round) {
    QuantizedMesh mesh = random_mesh(random, 1 + random() % 30, Extensions::kNone);
    const std::size_t plain_bytes = encode(mesh).size();
    mesh.normals.assign(mesh.vertex_count(), OctNormal{1, 2});
    const std::size_t bytes_with_normals = encode(mesh).size();
    mesh.metadata_json = "{\"available\":[]}";
    const Bytes bytes = encode(mesh);
    for (std::size_t size = 0; size < bytes.size(); ++size) {
      // A cut between two extensions leaves a whole tile with fewer of them.
      const bool is_whole = size == plain_bytes || size == bytes_with_normals;
      const auto decoded = decode(std::span(bytes).first(size));
      ASSERT_EQ(decoded.ok(), is_whole) << "cut at byte " << size << " of " << bytes.size();
    }
  }
}

TEST(QuantizedMesh, EveryFlippedBitIsRefusedOrGivesATileThatEncodesAgain) {
  std::mt19937_64 random(13);
  for (int round = 0; round < 5; ++round) {
    QuantizedMesh mesh = random_mesh(random, 3 + random() % 20, Extensions::kNone);
    mesh.normals.assign(mesh.vertex_count(), OctNormal{1, 2});
    mesh.water_mask = {255};
    mesh.metadata_json = "{}";
    Bytes bytes = encode(mesh);
    for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
      bytes[bit / 8] ^= static_cast<std::uint8_t>(1U << (bit % 8));
      const auto decoded = decode(bytes);
      if (decoded.ok()) {
        const auto again = decode(encode(*decoded));
        ASSERT_TRUE(again.ok()) << again.error().message;
        ASSERT_TRUE(equal_bits(*again, *decoded)) << "bit " << bit;
      }
      bytes[bit / 8] ^= static_cast<std::uint8_t>(1U << (bit % 8));
    }
  }
}

TEST(QuantizedMesh, UnknownExtensionsAreSkipped) {
  Bytes bytes = encode(square());
  append_extension(bytes, 3, {9, 9, 9});
  append_extension(bytes, 2, {255});
  append_extension(bytes, 200, {});
  append_extension(bytes, 3, {1});
  const auto decoded = decode(bytes);
  ASSERT_TRUE(decoded.ok()) << decoded.error().message;
  EXPECT_EQ(decoded->water_mask, Bytes{255});
  EXPECT_TRUE(decoded->normals.empty());
}

TEST(QuantizedMesh, HostileCountsAreRefusedWithoutAllocatingForThem) {
  const Bytes good = encode(square());
  const std::size_t triangles_at = 92 + 24;
  const std::size_t west_at = triangles_at + 4 + 12;
  for (const std::size_t at :
       {std::size_t{88}, triangles_at, west_at, west_at + 8, west_at + 16, west_at + 24}) {
    for (const std::uint32_t count :
         {0xFFFFFFFFU, 0x80000000U, 0x55555556U, 0x2AAAAAABU, 100000U}) {
      Bytes bytes = good;
      put_u32(bytes, at, count);
      EXPECT_FALSE(decode(bytes).ok()) << at << ": " << count;
    }
  }
  Bytes bytes = good;
  append_extension(bytes, 1, Bytes(8));
  put_u32(bytes, good.size() + 1, 0xFFFFFFFFU);
  EXPECT_THAT(fault_of(bytes), HasSubstr("within extension 1"));
}

TEST(QuantizedMesh, TrailingBytesThatFormNoExtensionAreRefused) {
  Bytes bytes = encode(square());
  for (std::size_t count = 1; count < 5; ++count) {
    bytes.push_back(7);
    EXPECT_THAT(fault_of(bytes), HasSubstr("are no extension"));
  }
}

TEST(QuantizedMesh, FaultsAreNamed) {
  const Bytes good = encode(square());
  Bytes bytes = good;
  put_u32(bytes, 88, 0);
  EXPECT_THAT(fault_of(bytes), HasSubstr("no vertices"));

  bytes = good;
  bytes[92] = 1;  // u of the first vertex: -1
  EXPECT_EQ(fault_of(bytes), "u of vertex 0 lies outside 0..32767");

  bytes = good;
  bytes[120] = 1;  // the first index's code
  EXPECT_THAT(fault_of(bytes), HasSubstr("triangle 0 has index code 1 where the highest"));

  bytes = good;
  bytes[136] = 4;
  EXPECT_EQ(fault_of(bytes), "the west list names vertex 4 of 4");

  bytes = good;
  bytes[132] = 5;
  EXPECT_EQ(fault_of(bytes), "the west list holds 5 indices, but the tile has 4 vertices");

  bytes = good;
  append_extension(bytes, 1, Bytes(4));
  EXPECT_EQ(
      fault_of(bytes),
      "the normals extension gives its length as 4, but 2 bytes for each of 4 vertices make 8");

  bytes = good;
  append_extension(bytes, 2, Bytes(2));
  EXPECT_THAT(fault_of(bytes), HasSubstr("water mask has 2 bytes"));

  bytes = good;
  append_extension(bytes, 4, {3, 0, 0, 0, '{', '}'});
  EXPECT_THAT(fault_of(bytes), HasSubstr("text's length as 3, but holds 2"));

  bytes = good;
  append_extension(bytes, 4, {1, 0});
  EXPECT_THAT(fault_of(bytes), HasSubstr("too few"));

  bytes = good;
  append_extension(bytes, 2, {0});
  append_extension(bytes, 2, {0});
  EXPECT_EQ(fault_of(bytes), "extension 2 is there twice");
}

TEST(QuantizedMesh, EncodeRefusesWhatItsContractForbids) {
  QuantizedMesh mesh = square();
  mesh.indices = {1, 0, 2, 2, 0, 3};  // not in order of first use
  EXPECT_THROW(encode(mesh), InternalError);
  mesh = square();
  mesh.h[2] = 32768;
  EXPECT_THROW(encode(mesh), InternalError);
  mesh = square();
  mesh.sides[3].push_back(4);
  EXPECT_THROW(encode(mesh), InternalError);
  mesh = square();
  mesh.normals.resize(3);
  EXPECT_THROW(encode(mesh), InternalError);
  mesh = square();
  mesh.indices.insert(mesh.indices.end(), {4, 0, 1});
  EXPECT_THROW(encode(mesh), InternalError);
  EXPECT_THROW(encode(QuantizedMesh{}), InternalError);
}

TEST(OctNormal, DecodedNormalsAreUnitAndWithinADegree) {
  std::mt19937_64 random(17);
  std::normal_distribution<double> gauss;
  double worst = 1;
  for (int i = 0; i < 200000; ++i) {
    Vec3 n = {gauss(random), gauss(random), gauss(random)};
    const double length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (double& value : n) value /= length;
    const Vec3 d = decode_oct_normal(encode_oct_normal(n));
    ASSERT_NEAR(d[0] * d[0] + d[1] * d[1] + d[2] * d[2], 1, 1e-12);
    worst = std::min(worst, n[0] * d[0] + n[1] * d[1] + n[2] * d[2]);
  }
  EXPECT_GT(worst, std::cos(1.0 * 3.14159265358979 / 180)) << std::acos(worst) * 180 / 3.14159;
}

TEST(OctNormal, TheAxesHaveCesiumsBytes) {
  // As AttributeCompression.octEncode gives them.
  EXPECT_EQ(encode_oct_normal({0, 0, 1}), (OctNormal{128, 128}));
  EXPECT_EQ(encode_oct_normal({0, 0, -1}), (OctNormal{255, 255}));
  EXPECT_EQ(encode_oct_normal({1, 0, 0}), (OctNormal{255, 128}));
  EXPECT_EQ(encode_oct_normal({-1, 0, 0}), (OctNormal{0, 128}));
  EXPECT_EQ(encode_oct_normal({0, 1, 0}), (OctNormal{128, 255}));
  EXPECT_EQ(encode_oct_normal({0, -1, 0}), (OctNormal{128, 0}));
}

}  // namespace
}  // namespace qmpipe::quantized_mesh_test
