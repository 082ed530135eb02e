#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>
#include <unordered_map>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"
#include "formats/bytes/folders.h"
#include "formats/bytes/gzip.h"
#include "formats/bytes/hash64.h"
#include "formats/bytes/random_access_file.h"
#include "formats/pmtiles/directory.h"
#include "formats/pmtiles/id.h"
#include "formats/pmtiles/pmtiles.h"
#include "formats/tile/layer_json.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

namespace fs = std::filesystem;

constexpr int kMetadataGzipLevel = 9;

// A file that is removed unless it took its name.
class UnfinishedFile {
 public:
  explicit UnfinishedFile(fs::path target)
      : target_(std::move(target)),
        file_(RandomAccessFile::create(target_.string() + kTemporarySuffix)) {}
  ~UnfinishedFile() {
    if (!has_name_) ::unlink(file_.path().c_str());
  }
  UnfinishedFile(const UnfinishedFile&) = delete;
  UnfinishedFile& operator=(const UnfinishedFile&) = delete;

  RandomAccessFile& file() { return file_; }
  const RandomAccessFile& file() const { return file_; }
  const fs::path& target() const { return target_; }

  void finish() {
    file_.sync();
    file_.close();
    if (::rename(file_.path().c_str(), target_.c_str()) != 0) {
      throw_io_error("cannot write", target_, errno);
    }
    has_name_ = true;
    sync_folder_of(target_);
  }

 private:
  const fs::path target_;
  RandomAccessFile file_;
  bool has_name_ = false;
};

std::vector<std::uint8_t> metadata_of(const std::string& layer_json, const LayerJson& layer,
                                      Projection projection) {
  const nlohmann::ordered_json metadata = {
      {"name", layer.name},
      {"description", layer.description},
      {"attribution", layer.attribution},
      {"version", layer.version},
      {"type", "baselayer"},
      {"format", "application/vnd.quantized-mesh"},
      {"tiling", projection == Projection::kGeodetic ? kTilingGeodetic : kTilingMercator},
      {kLayerJsonKey, layer_json}};
  const std::string text =
      metadata.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  return gzip_compress({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()},
                       kMetadataGzipLevel);
}

class PmtilesSink final : public TileSink {
 public:
  PmtilesSink(const fs::path& path, Projection projection)
      : projection_(projection), unfinished_(path) {}

  void write(const TileKey& key, std::span<const std::uint8_t> bytes) override {
    QMPIPE_CHECK(!is_closed_);
    const std::uint64_t id = pmtiles_id(key, projection_);
    QMPIPE_CHECK(entries_.empty() || id >= entries_.back().id + entries_.back().run_length);
    if (bytes.empty() || bytes.size() > std::numeric_limits<std::uint32_t>::max()) {
      throw IoError(
          "cannot put tile " + to_string(key) + " into", unfinished_.target().string(),
          fmt::format("it has {} bytes, and an archive's tiles have 1 to 2^32 - 1", bytes.size()),
          "Remove the tile from the set, or choose another form.");
    }
    // One plain tile in many millions looks gzipped; not all of them do.
    are_gzipped_ = are_gzipped_ && is_gzip(bytes);
    const std::uint64_t offset = stored_at(bytes);
    if (!entries_.empty() && continues(entries_.back(), id, offset)) {
      ++entries_.back().run_length;
    } else {
      entries_.push_back({.id = id,
                          .offset = offset,
                          .bytes = static_cast<std::uint32_t>(bytes.size()),
                          .run_length = 1});
    }
  }

  void sync() override { unfinished_.file().sync(); }

  bool has(const TileKey& key) const override {
    const std::uint64_t id = pmtiles_id(key, projection_);
    const auto after =
        std::upper_bound(entries_.begin(), entries_.end(), id,
                         [](std::uint64_t wanted, const PmtilesEntry& e) { return wanted < e.id; });
    return after != entries_.begin() && id - (after - 1)->id < (after - 1)->run_length;
  }

  void close(const std::string& layer_json) override {
    QMPIPE_CHECK(!is_closed_);
    if (entries_.empty()) {
      throw IoError("cannot finish", unfinished_.target().string(),
                    "there is no tile, and an archive without tiles is none",
                    "Check the set that it is made from.");
    }
    // Tiles are what is kept of a set whose layer.json says nothing.
    const auto parsed = parse_layer_json(layer_json);
    const LayerJson layer = parsed ? parsed->layer : LayerJson();
    const std::vector<std::uint8_t> metadata = metadata_of(layer_json, layer, projection_);
    const PmtilesDirectories directories = write_pmtiles_directories(entries_);
    PmtilesHeader header = header_for(layer);
    header.root = {.offset = kPmtilesHeaderBytes, .bytes = directories.root.size()};
    header.metadata = {.offset = header.tiles.offset + header.tiles.bytes,
                       .bytes = metadata.size()};
    header.leaves = {.offset = header.metadata.offset + header.metadata.bytes,
                     .bytes = directories.leaves.size()};
    RandomAccessFile& file = unfinished_.file();
    file.write(header.metadata.offset, metadata);
    file.write(header.leaves.offset, directories.leaves);
    file.write(header.root.offset, directories.root);
    file.write(0, write_pmtiles_header(header));
    unfinished_.finish();
    is_closed_ = true;
  }

 private:
  static bool continues(const PmtilesEntry& last, std::uint64_t id, std::uint64_t offset) {
    return id == last.id + last.run_length && offset == last.offset &&
           last.run_length < std::numeric_limits<std::uint32_t>::max();
  }

  // Where the tile section holds these bytes, from now on if not before.
  std::uint64_t stored_at(std::span<const std::uint8_t> bytes) {
    const std::uint64_t hash = hash64(bytes, 0);
    const auto [place, is_new] =
        places_.try_emplace(hash, PmtilesSection{.offset = tile_bytes_, .bytes = bytes.size()});
    if (!is_new && holds(place->second, bytes)) return place->second.offset;
    // Other bytes of the same hash, if ever, are stored without being remembered.
    const std::uint64_t offset = tile_bytes_;
    unfinished_.file().write(kPmtilesRootEnd + offset, bytes);
    tile_bytes_ += bytes.size();
    ++content_count_;
    return offset;
  }

  bool holds(const PmtilesSection& place, std::span<const std::uint8_t> bytes) const {
    if (place.bytes != bytes.size()) return false;
    const auto stored = unfinished_.file().read(kPmtilesRootEnd + place.offset, place.bytes);
    if (!stored) {
      throw IoError("cannot go on with", unfinished_.file().path().string(), stored.error().message,
                    "");
    }
    return std::equal(bytes.begin(), bytes.end(), stored->begin());
  }

  // All but the sections that are written last.
  PmtilesHeader header_for(const LayerJson& layer) const {
    PmtilesHeader header;
    header.tiles = {.offset = kPmtilesRootEnd, .bytes = tile_bytes_};
    header.entries = entries_.size();
    for (const PmtilesEntry& entry : entries_) header.addressed_tiles += entry.run_length;
    header.contents = content_count_;
    header.is_clustered = true;
    header.tile_compression = are_gzipped_ ? PmtilesCompression::kGzip : PmtilesCompression::kNone;
    header.min_zoom = zoom_of(entries_.front().id);
    header.max_zoom = zoom_of(entries_.back().id + entries_.back().run_length - 1);
    header.bounds_deg = layer.bounds_deg;
    header.centre_zoom = header.min_zoom;
    header.centre_longitude_deg = (layer.bounds_deg.west_deg + layer.bounds_deg.east_deg) / 2;
    header.centre_latitude_deg = (layer.bounds_deg.south_deg + layer.bounds_deg.north_deg) / 2;
    return header;
  }

  static std::uint8_t zoom_of(std::uint64_t id) {
    return static_cast<std::uint8_t>(archive_position(id)->zoom);
  }

  const Projection projection_;
  UnfinishedFile unfinished_;
  std::vector<PmtilesEntry> entries_;
  // By hash, within the tile section.
  std::unordered_map<std::uint64_t, PmtilesSection> places_;
  std::uint64_t tile_bytes_ = 0;
  std::uint64_t content_count_ = 0;
  bool are_gzipped_ = true;
  bool is_closed_ = false;
};

}  // namespace

std::unique_ptr<TileSink> open_pmtiles_sink(const fs::path& path, Overwrite overwrite,
                                            Projection projection) {
  std::error_code code;
  if (overwrite == Overwrite::kNo && fs::exists(fs::symlink_status(path, code))) {
    throw IoError("cannot write", path.string(), "the file exists",
                  "Choose another name, or pass --overwrite to replace it.");
  }
  if (path.has_parent_path()) make_folders(path.parent_path());
  return std::make_unique<PmtilesSink>(path, projection);
}

}  // namespace qmpipe
