#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "formats/bytes/errors.h"
#include "formats/bytes/random_access_file.h"
#include "formats/pmtiles/directory.h"
#include "formats/pmtiles/id.h"
#include "formats/pmtiles/pmtiles.h"
#include "formats/tile/layer_json.h"

namespace qmpipe {
namespace {

using MetadataJson = nlohmann::json;
using Bytes = std::vector<std::uint8_t>;

// What the metadata tell of the tiles.
struct Metadata {
  std::string layer_text;  // empty where there is none
  Projection projection = Projection::kMercator;
};

Result<Metadata> parse_metadata(const Bytes& text) {
  // Without exceptions: the bytes are anybody's.
  const MetadataJson json = MetadataJson::parse(text.begin(), text.end(), nullptr, false);
  if (!json.is_object()) return Error{"the metadata are no JSON object"};
  Metadata metadata;
  if (const auto layer = json.find(kLayerJsonKey); layer != json.end() && layer->is_string()) {
    metadata.layer_text = layer->get<std::string>();
  }
  if (const auto tiling = json.find("tiling"); tiling != json.end() && tiling->is_string()) {
    if (*tiling == kTilingGeodetic) metadata.projection = Projection::kGeodetic;
  } else if (!metadata.layer_text.empty()) {
    const auto layer = parse_layer_json(metadata.layer_text);
    if (layer) metadata.projection = layer->layer.projection;
  }
  return metadata;
}

class PmtilesSet final : public TileSet {
 public:
  explicit PmtilesSet(const std::filesystem::path& path)
      : file_(RandomAccessFile::open_to_read(path)) {
    auto index = read_pmtiles_index(
        [this](std::uint64_t offset, std::uint64_t bytes) { return file_.read(offset, bytes); },
        file_.size_bytes());
    if (!index) refuse(index.error());
    index_ = std::move(*index);
    read_metadata();
    list_keys();
  }

  Result<std::string> layer_text() const override {
    if (!metadata_.layer_text.empty()) return metadata_.layer_text;
    return Error{
        fmt::format("the metadata of {} hold no {}", file_.path().string(), kLayerJsonKey)};
  }
  const std::vector<TileKey>& keys() const override { return keys_; }
  const std::vector<std::string>& strays() const override { return strays_; }

  Result<Bytes> read(const TileKey& key) const override {
    const PmtilesEntry* const entry = entry_of(key);
    if (entry == nullptr) return no_tile(key);
    if (entry->bytes > kLargestTileBytes) {
      return Error{fmt::format("tile {} has {} bytes, more than the {} allowed", to_string(key),
                               entry->bytes, kLargestTileBytes)};
    }
    return file_.read(index_.header.tiles.offset + entry->offset, entry->bytes);
  }
  Result<std::int64_t> stored_bytes(const TileKey& key) const override {
    const PmtilesEntry* const entry = entry_of(key);
    if (entry == nullptr) return no_tile(key);
    return std::int64_t{entry->bytes};
  }

 private:
  [[noreturn]] void refuse(const Error& error) const {
    throw IoError("cannot open the archive", file_.path().string(), error.message,
                  "Check that it is a whole PMTiles file of version 3.");
  }

  Error no_tile(const TileKey& key) const {
    return Error{fmt::format("there is no tile {} in {}", to_string(key), file_.path().string())};
  }

  void read_metadata() {
    const PmtilesSection& section = index_.header.metadata;
    if (section.bytes == 0) return;
    auto stored = file_.read(section.offset, section.bytes);
    if (!stored) refuse(stored.error());
    const auto text = plain_pmtiles_section(std::move(*stored), index_.header.directory_compression,
                                            kLargestTileBytes);
    if (!text) refuse({"its metadata: " + text.error().message});
    auto metadata = parse_metadata(*text);
    if (!metadata) refuse(metadata.error());
    metadata_ = std::move(*metadata);
  }

  void list_keys() {
    for (const PmtilesEntry& entry : index_.entries) {
      std::uint64_t strays = 0;
      std::uint64_t first_stray = 0;
      for (std::uint64_t id = entry.id; id < entry.id + entry.run_length; ++id) {
        if (const auto key = key_of_archive_id(id, metadata_.projection)) {
          keys_.push_back(*key);
        } else if (strays++ == 0) {
          first_stray = id;
        }
      }
      if (strays > 0) strays_.push_back(stray_text(first_stray, strays - 1));
    }
    std::sort(keys_.begin(), keys_.end());
    std::sort(strays_.begin(), strays_.end());
  }

  static std::string stray_text(std::uint64_t id, std::uint64_t more) {
    const auto at = archive_position(id);
    const std::string text =
        at ? fmt::format("{}/{}/{}", at->zoom, at->x, at->y) : fmt::format("tile id {}", id);
    return more == 0 ? text : fmt::format("{} and {} more of its run", text, more);
  }

  // Null when there is none.
  const PmtilesEntry* entry_of(const TileKey& key) const {
    if (!TilingScheme(metadata_.projection).contains(key)) return nullptr;
    const std::uint64_t id = pmtiles_id(key, metadata_.projection);
    const auto after =
        std::upper_bound(index_.entries.begin(), index_.entries.end(), id,
                         [](std::uint64_t wanted, const PmtilesEntry& e) { return wanted < e.id; });
    if (after == index_.entries.begin()) return nullptr;
    const PmtilesEntry& entry = *(after - 1);
    return id - entry.id < entry.run_length ? &entry : nullptr;
  }

  const RandomAccessFile file_;
  PmtilesIndex index_;
  Metadata metadata_;
  std::vector<TileKey> keys_;
  std::vector<std::string> strays_;
};

}  // namespace

std::unique_ptr<TileSet> open_pmtiles_set(const std::filesystem::path& path) {
  return std::make_unique<PmtilesSet>(path);
}

}  // namespace qmpipe
