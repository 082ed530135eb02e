// HDF5 files under a right seal that somebody made to do harm: they are refused, by every reader of
// such files, before another file is touched or memory taken that the file could not fill.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <functional>
#include <random>
#include <string>

#include "formats/bytes/file_bytes.h"
#include "formats/bytes/hash64.h"
#include "formats/bytes/little_endian.h"
#include "formats/bytes/seal.h"
#include "formats/detail_model/arrays.h"
#include "formats/detail_model/file.h"
#include "formats/detail_model/file_layout.h"
#include "formats/hdf5/segment_files.h"
#include "formats/run_store/border_segment.h"
#include "formats/run_store/lattice_segment.h"
#include "tests/support/lattice_blocks.h"
#include "tests/support/random_borders.h"
#include "tests/support/random_detail_model.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::hostile_test {
namespace {

namespace fs = std::filesystem;
using ::testing::AnyOf;
using ::testing::HasSubstr;
using testing::TemporaryFolder;
using Bytes = std::vector<std::uint8_t>;

const TilingScheme kGeodetic{Projection::kGeodetic};
constexpr std::int32_t kMaxTestZoom = 5;

// A kind of file: who it says it is, what is read of it first, how it is read and written.
struct Kind {
  std::string name;
  SegmentIdentity identity;
  std::string first;
  std::int64_t type;
  std::vector<hsize_t> shape;
  std::function<std::string(const fs::path&)> error_of_reading;
  std::function<void(const fs::path&)> write;
};

template <class T>
std::string error_in(const Result<T>& result) {
  return result.ok() ? "" : result.error().message;
}

void write_lattice(const fs::path& path) {
  std::vector<std::shared_ptr<const PackedBlock>> blocks;
  for (std::int32_t k = 0; k < 3; ++k) {
    PackedBlock block = {.key = {.zoom = 4, .x = k, .y = 1}, .chunk = Bytes(90, 7)};
    block.content_hash = content_hash(block.key, block.chunk);
    blocks.push_back(std::make_shared<const PackedBlock>(block));
  }
  write_file_atomically(path, encode_lattice_segment(path, kGeodetic, blocks).bytes);
}

void write_borders(const fs::path& path) {
  std::vector<Border> borders;
  for (std::int32_t n = 0; n < 700; ++n) {
    borders.push_back({.key = testing::border_of_number(n), .mask = testing::mask_of_seed(3)});
  }
  std::sort(borders.begin(), borders.end(),
            [](const Border& a, const Border& b) { return a.key < b.key; });
  write_file_atomically(path, encode_border_segment(path, kGeodetic, borders, 1).bytes);
}

void write_detail(const fs::path& path) {
  std::mt19937_64 random(5);
  write_detail_file(path, testing::random_detail_model(random, 60));
}

std::vector<Kind> kinds() {
  return {{"detail",
           detail_identity(),
           kDetailFrame,
           H5T_IEEE_F64LE,
           {2, 3},
           [](const fs::path& path) { return error_in(read_detail_file(path)); },
           write_detail},
          {"lattice",
           store_identity(kSegmentFormatVersion, kGeodetic),
           "keys",
           H5T_STD_I32LE,
           {1, 3},
           [](const fs::path& path) {
             return error_in(read_lattice_segment(path, kGeodetic, kMaxTestZoom));
           },
           write_lattice},
          {"borders",
           store_identity(kBorderSegmentVersion, kGeodetic),
           "borders",
           H5T_STD_I32LE,
           {4},
           [](const fs::path& path) {
             return error_in(read_border_segment(path, kGeodetic, kMaxTestZoom));
           },
           write_borders}};
}

Bytes bytes_of(const fs::path& path) {
  const auto bytes = read_file_bytes(path, std::size_t{1} << 30U);
  EXPECT_TRUE(bytes.ok());
  return *bytes;
}

void seal(const fs::path& path) {
  Bytes bytes = bytes_of(path);
  append_seal(bytes, {});
  write_file_atomically(path, bytes);
}

void add_attribute(hid_t file, const char* name, hid_t type, hid_t space, const void* value) {
  const Hdf5Handle attribute(H5Acreate2(file, name, type, space, H5P_DEFAULT, H5P_DEFAULT),
                             H5Aclose);
  EXPECT_GE(H5Awrite(attribute.id(), type, value), 0);
}

void add_identity(hid_t file, const SegmentIdentity& identity) {
  const Hdf5Handle scalar(H5Screate(H5S_SCALAR), H5Sclose);
  add_attribute(file, "format_version", H5T_NATIVE_INT32, scalar.id(), &identity.format_version);
  const Hdf5Handle text(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(text.id(), identity.value.size());
  add_attribute(file, identity.attribute, text.id(), scalar.id(), identity.value.data());
}

class Hdf5Hostile : public ::testing::TestWithParam<Kind> {
 protected:
  // What the reader says to a file that HDF5 made, sealed.
  std::string error_of(const std::function<void(hid_t)>& fill) const {
    {
      const Hdf5Handle file(H5Fcreate(path().c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT),
                            H5Fclose);
      EXPECT_TRUE(file.ok());
      fill(file.id());
    }
    seal(path());
    return GetParam().error_of_reading(path());
  }
  // The same with a right identity, and the first dataset made as `creation` says.
  std::string error_of_first(const std::function<void(hid_t)>& creation, hid_t type) const {
    return error_of([&](hid_t file) {
      add_identity(file, GetParam().identity);
      const std::vector<hsize_t>& shape = GetParam().shape;
      const Hdf5Handle space(
          H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr), H5Sclose);
      const Hdf5Handle list(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
      creation(list.id());
      const Hdf5Handle data(H5Dcreate2(file, GetParam().first.c_str(), type, space.id(),
                                       H5P_DEFAULT, list.id(), H5P_DEFAULT),
                            H5Dclose);
      EXPECT_TRUE(data.ok());
    });
  }
  fs::path path() const { return folder_.path() / "forged.h5"; }

  const TemporaryFolder folder_;
};

TEST_P(Hdf5Hostile, ReadsWhatTheWriterMade) {
  GetParam().write(path());
  EXPECT_EQ(GetParam().error_of_reading(path()), "");
}

TEST_P(Hdf5Hostile, RefusesAVersionThatIsNoSingleInteger) {
  const hsize_t four = 4;
  const hsize_t one = 1;
  const Hdf5Handle row(H5Screate_simple(1, &four, nullptr), H5Sclose);
  const Hdf5Handle single(H5Screate_simple(1, &one, nullptr), H5Sclose);
  const Hdf5Handle scalar(H5Screate(H5S_SCALAR), H5Sclose);
  const std::array<std::uint8_t, 64> zeros = {};
  const std::vector<std::pair<hid_t, hid_t>> wrong = {
      {H5T_STD_I8LE, row.id()},     {H5T_STD_I32LE, row.id()},     {H5T_STD_I32LE, single.id()},
      {H5T_STD_I32BE, scalar.id()}, {H5T_IEEE_F32LE, scalar.id()}, {H5T_STD_I64LE, scalar.id()}};
  for (std::size_t k = 0; k < wrong.size(); ++k) {
    const std::string error = error_of([&](hid_t file) {
      add_attribute(file, "format_version", wrong[k].first, wrong[k].second, zeros.data());
    });
    EXPECT_THAT(error, HasSubstr("it has no format version")) << k;
  }
}

TEST_P(Hdf5Hostile, RefusesATextThatIsNone) {
  const Hdf5Handle scalar(H5Screate(H5S_SCALAR), H5Sclose);
  const Hdf5Handle endless(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(endless.id(), H5T_VARIABLE);
  const char* const text = "geodetic";
  const std::string error = error_of([&](hid_t file) {
    const std::int32_t version = GetParam().identity.format_version;
    add_attribute(file, "format_version", H5T_NATIVE_INT32, scalar.id(), &version);
    add_attribute(file, GetParam().identity.attribute, endless.id(), scalar.id(), &text);
  });
  EXPECT_THAT(error, HasSubstr("is no text of ours"));
}

TEST_P(Hdf5Hostile, NeverLooksIntoAnotherFile) {
  const fs::path other = folder_.path() / "other";
  // Who opens it to read waits for ever.
  ASSERT_EQ(::mkfifo(other.c_str(), 0600), 0);
  const auto outside = [&](hid_t list) {
    EXPECT_GE(H5Pset_external(list, other.c_str(), 0, 48), 0);
  };
  EXPECT_THAT(error_of_first(outside, GetParam().type), HasSubstr("its values are in other files"));
  const auto virtual_one = [&](hid_t list) {
    const std::vector<hsize_t>& shape = GetParam().shape;
    const Hdf5Handle space(H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr),
                           H5Sclose);
    EXPECT_GE(H5Pset_virtual(list, space.id(), other.c_str(), "x", space.id()), 0);
  };
  EXPECT_NE(error_of_first(virtual_one, GetParam().type), "");
  const std::string& first = GetParam().first;
  const std::string linked = error_of([&](hid_t file) {
    add_identity(file, GetParam().identity);
    EXPECT_GE(
        H5Lcreate_external(other.c_str(), "/x", file, first.c_str(), H5P_DEFAULT, H5P_DEFAULT), 0);
  });
  EXPECT_THAT(linked, HasSubstr(path().string()));
  const std::string soft = error_of([&](hid_t file) {
    add_identity(file, GetParam().identity);
    EXPECT_GE(H5Lcreate_soft("/x", file, first.c_str(), H5P_DEFAULT, H5P_DEFAULT), 0);
  });
  EXPECT_THAT(soft, HasSubstr("it holds a link"));
}

TEST_P(Hdf5Hostile, RefusesNumbersOfAnotherTypeOrBehindFilters) {
  const auto nothing = [](hid_t) {};
  for (const hid_t type : {H5T_IEEE_F32LE, H5T_STD_I64LE, H5T_STD_U32LE, H5T_STD_I32BE}) {
    EXPECT_THAT(error_of_first(nothing, type),
                AnyOf(HasSubstr("has another shape"), HasSubstr("cannot be read")));
  }
  const auto packed = [](hid_t list) {
    const std::vector<hsize_t>& shape = GetParam().shape;
    EXPECT_GE(H5Pset_chunk(list, static_cast<int>(shape.size()), shape.data()), 0);
    EXPECT_GE(H5Pset_deflate(list, 9), 0);
  };
  EXPECT_THAT(error_of_first(packed, GetParam().type), HasSubstr("has another shape"));
}

TEST_P(Hdf5Hostile, RefusesANamedPipe) {
  ASSERT_EQ(::mkfifo(path().c_str(), 0600), 0);
  EXPECT_THAT(GetParam().error_of_reading(path()), HasSubstr(path().string()));
}

// What may be read is bounded by the length of the file: it must be the real one.
TEST_P(Hdf5Hostile, RefusesALengthThatTheFileDoesNotHave) {
  GetParam().write(path());
  const Bytes whole = bytes_of(path());
  const auto body = without_seal(whole);
  const std::uint32_t seed = 20261129;
  std::mt19937_64 random(seed);
  for (int k = 0; k < 60; ++k) {
    Bytes longer(body.begin(), body.end());
    constexpr std::size_t kEndOfFileAt = 40;
    const std::uint64_t more = 4096 + (random() >> (1 + static_cast<unsigned>(k)));
    store_little_endian(longer.data() + kEndOfFileAt, body.size() + more);
    append_seal(longer, {});
    write_file_atomically(path(), longer);
    EXPECT_THAT(GetParam().error_of_reading(path()), HasSubstr("shorter than it says"))
        << "seed " << seed << ", " << more << " more";
  }
}

// Whatever is changed behind the seal: a model or an error, and never a crash. Few bytes are heights,
// so most changes hit HDF5's own structure.
TEST_P(Hdf5Hostile, TrustsNoByteBehindTheSeal) {
  GetParam().write(path());
  const Bytes whole = bytes_of(path());
  const auto body = without_seal(whole);
  std::mt19937_64 random(51);
  int refused = 0;
  for (int k = 0; k < 1500; ++k) {
    Bytes damaged(body.begin(), body.end());
    const std::size_t changes = 1 + random() % 4;
    for (std::size_t n = 0; n < changes; ++n) {
      // The first bytes lead to all others.
      const std::size_t reach = random() % 2 == 0 ? damaged.size() : 1500;
      const std::array<std::uint8_t, 4> values = {0, 0xFF, 1, static_cast<std::uint8_t>(random())};
      damaged[random() % std::min(reach, damaged.size())] = values[random() % 4];
    }
    append_seal(damaged, {});
    write_file_atomically(path(), damaged);
    const std::string error = GetParam().error_of_reading(path());
    if (error.empty()) continue;
    ++refused;
    ASSERT_THAT(error, HasSubstr(path().string())) << "change " << k << ", seed 51";
  }
  EXPECT_GT(refused, 200);
}

INSTANTIATE_TEST_SUITE_P(Readers, Hdf5Hostile, ::testing::ValuesIn(kinds()),
                         [](const auto& test_case) { return test_case.param.name; });

TEST(FileSeal, RefusesPartsThatOverlapOrAreOutOfOrder) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "file";
  const auto error_with = [&](const std::vector<ByteRange>& parts) {
    Bytes file(1000, 1);
    append_seal(file, {});
    file.resize(1000);
    // As append_seal() would, of other parts.
    std::uint64_t hash = 0x716D706970650001ULL;
    const auto append = [&file](std::uint64_t value) { append_little_endian(file, value); };
    for (const ByteRange& part : parts) {
      hash = hash64(std::span(file).subspan(part.offset, part.bytes), hash);
    }
    for (const ByteRange& part : parts) {
      append(part.offset);
      append(part.bytes);
    }
    append(hash);
    append(1000);
    append(parts.size());
    append(hash64(std::span(file).subspan(1000), 0x716D706970650001ULL));
    const std::string magic = "QMPSEAL1";
    file.insert(file.end(), magic.begin(), magic.end());
    write_file_atomically(path, file);
    const auto error = check_seal(path);
    return error ? error->message : "";
  };
  EXPECT_EQ(error_with({{0, 400}, {500, 500}}), "");
  EXPECT_THAT(error_with({{0, 400}, {399, 10}}), HasSubstr("out of order"));
  EXPECT_THAT(error_with({{500, 10}, {0, 400}}), HasSubstr("out of order"));
  EXPECT_THAT(error_with({{0, 0}, {0, 1000}}), HasSubstr("out of order"));
  EXPECT_THAT(error_with(std::vector<ByteRange>(100000, {0, 1000})), HasSubstr("out of order"));
}

// As many zeros as a model of 40 million points has, packed to almost nothing.
TEST(DetailBomb, IsRefusedBeforeItsMemoryIsTaken) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "bomb.h5";
  constexpr std::uint64_t kPoints = 40'000'000;
  Hdf5SegmentWriter file(path, detail_identity());
  file.write_values(kDetailFrame, 3, std::vector<double>{0, 0, 0, 1, 1, 1});
  file.write_values(kDetailInterval, 1, std::vector<std::uint64_t>{1});
  file.write_values(kDetailSeams, 1, std::vector<std::uint64_t>{0});
  file.write_values(kDetailBlocks, 3, std::vector<std::uint64_t>{kPoints, 0, 0});
  const std::vector<std::uint32_t> zeros(kMaxChunkWords, 0);
  const Bytes chunk = pack_words(zeros, kMaxChunkWords, 1);
  for (const char* name : {"point_x", "point_y", "point_z"}) {
    file.create_chunked(name, H5T_STD_U32LE, {kPoints}, {kMaxChunkWords}, H5T_NATIVE_UINT32,
                        nullptr);
    for (std::uint64_t row = 0; row < kPoints; row += kMaxChunkWords) file.write_chunk(row, chunk);
  }
  write_file_atomically(path, file.finish_whole(0));
  ASSERT_LT(fs::file_size(path), 1U << 20U);
  rusage before = {};
  ::getrusage(RUSAGE_SELF, &before);
  EXPECT_THAT(error_in(read_detail_file(path)), HasSubstr("claims more than its"));
  rusage after = {};
  ::getrusage(RUSAGE_SELF, &after);
  EXPECT_LT(after.ru_maxrss - before.ru_maxrss, 50 * 1024);  // KiB
}

TEST(DetailBomb, AModelOfZerosIsWrittenSoThatItCanBeRead) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "flat.h5";
  DetailModel model;
  model.blocks = {{.points = std::vector<DetailPoint>(7'000'000),
                   .coarse_triangles = {},
                   .splits = {},
                   .svo_m = {0}}};
  write_detail_file(path, model);
  EXPECT_GT(fs::file_size(path), 20'000U);
  const auto back = read_detail_file(path);
  ASSERT_TRUE(back.ok()) << back.error().message;
  EXPECT_EQ(back->blocks[0].points.size(), 7'000'000U);
}

}  // namespace
}  // namespace qmpipe::hostile_test
