#include "pipeline/convert/convert.h"

#include <fmt/format.h>
#include <oneapi/tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <optional>
#include <system_error>
#include <utility>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"
#include "formats/bytes/gzip.h"
#include "formats/pmtiles/pmtiles.h"
#include "formats/tile_sets/fit_layer_json.h"
#include "pipeline/run/ordered_work.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr int kLevelOfMixedSets = 7;

// What is done to each tile.
enum class Change { kNone, kUnpack, kGzipPlainOnes, kGzipAll };

// A sink that leaves nothing behind unless it was closed.
class Output {
 public:
  Output(const ConvertOptions& options, Projection projection)
      : path_(options.output),
        sink_(form_of(path_) == TileForm::kPmtiles
                  ? open_pmtiles_sink(path_, options.overwrite, projection)
                  : open_tile_sink(path_, options.overwrite)) {}
  ~Output() {
    sink_.reset();
    if (is_closed_ || form_of(path_) == TileForm::kFolder) return;
    // An MBTiles sink keeps its file for a run that goes on with it; there is none here.
    for (const char* ending : {"", "-journal", "-wal", "-shm"}) {
      std::error_code ignored;
      std::filesystem::remove(path_.string() + kTemporarySuffix + ending, ignored);
    }
  }
  Output(const Output&) = delete;
  Output& operator=(const Output&) = delete;

  void write(const TileKey& key, std::span<const std::uint8_t> bytes) { sink_->write(key, bytes); }
  void close(const std::string& layer_json) {
    sink_->close(layer_json);
    is_closed_ = true;
  }

 private:
  const std::filesystem::path path_;
  std::unique_ptr<TileSink> sink_;
  bool is_closed_ = false;
};

class Converter {
 public:
  Converter(const TileSet& input, const ConvertOptions& options, Progress& progress)
      : input_(input), options_(options), progress_(progress), keys_(input.keys()) {}

  ConvertReport run() {
    const FittedLayer fitted = fit_layer_json(input_, options_.output.stem().string());
    const auto layer = parse_layer_json(fitted.text);
    QMPIPE_CHECK(layer.ok());
    projection_ = layer->layer.projection;
    require_tiles_of_the_scheme();
    tell_of(fitted, layer->scheme);
    const bool is_archive = form_of(options_.output) == TileForm::kPmtiles;
    if (is_archive) sort_for_pmtiles(keys_, projection_);
    if (!copy(change_wanted(), fitted.text)) {
      QMPIPE_CHECK(copy(Change::kGzipPlainOnes, fitted.text));
      note(
          fmt::format("{} of {} tiles were not gzipped and are now, at level {}: an archive has "
                      "one compression for all",
                      report_.repacked_tiles, keys_.size(), kLevelOfMixedSets));
    }
    return std::move(report_);
  }

 private:
  struct Tile {
    Result<Bytes> bytes;
    std::int64_t read_bytes = 0;
    bool is_repacked = false;
  };

  void note(std::string text) {
    progress_.note(text);
    report_.notes.push_back(std::move(text));
  }

  void require_tiles_of_the_scheme() const {
    if (keys_.empty()) {
      throw IoError("cannot make", options_.output.string(), "the set has no tiles",
                    "Check the path of the input.");
    }
    const TilingScheme scheme(projection_);
    for (const TileKey& key : keys_) {
      if (scheme.contains(key)) continue;
      throw IoError(
          "cannot make", options_.output.string(),
          fmt::format("tile {} lies outside the tiling that layer.json names ({})", to_string(key),
                      projection_ == Projection::kGeodetic ? "EPSG:4326" : "EPSG:3857"),
          "Correct \"projection\" in layer.json, or remove what is no tile of it.");
    }
  }

  void tell_of(const FittedLayer& fitted, const std::string& scheme) {
    for (const std::string& change : fitted.changes) note("layer.json: " + change);
    if (scheme == "slippyMap" && form_of(options_.output) != TileForm::kFolder) {
      note(
          "layer.json counts rows from the north (slippyMap); they keep their numbers, so that the "
          "file's own rows are upside down");
    }
    report_.strays = static_cast<std::int64_t>(input_.strays().size());
    if (report_.strays == 0) return;
    note(fmt::format("{} looks like a tile but is none and is left out{}", input_.strays().front(),
                     report_.strays == 1 ? "" : fmt::format(", with {} more", report_.strays - 1)));
  }

  Change change_wanted() const {
    switch (options_.packing) {
      case Packing::kKeep:
        return Change::kNone;
      case Packing::kPlain:
        return Change::kUnpack;
      case Packing::kGzip:
        return Change::kGzipAll;
    }
    return Change::kNone;
  }

  // False when gzipped and plain tiles met in an archive; then nothing is written.
  bool copy(Change change, const std::string& layer_text) {
    Output output(options_, projection_);
    const auto count = static_cast<std::int64_t>(keys_.size());
    report_.tiles = 0;
    report_.read_bytes = 0;
    report_.written_bytes = 0;
    report_.repacked_tiles = 0;
    std::optional<bool> is_gzipped;  // the first tile's
    bool are_mixed = false;
    const Phase phase(progress_, "convert", "tiles", count);
    const auto take = [&](const TileKey& key, const Tile& tile) {
      if (!tile.bytes) {
        throw IoError("cannot convert tile", to_string(key), tile.bytes.error().message,
                      "qmpipe verify finds all such tiles; remove or rebuild them.");
      }
      if (!is_gzipped) is_gzipped = is_gzip(*tile.bytes);
      are_mixed = change == Change::kNone && form_of(options_.output) == TileForm::kPmtiles &&
                  is_gzip(*tile.bytes) != *is_gzipped;
      if (are_mixed) return false;
      output.write(key, *tile.bytes);
      count_in(tile);
      return true;
    };
    work_in_order(
        options_.threads, count,
        [&](std::int64_t index) -> InTurn {
          const TileKey key = keys_[static_cast<std::size_t>(index)];
          return [&take, key, tile = tile_of(key, change)] { return take(key, tile); };
        },
        [this] { return progress_.should_stop(); });
    if (are_mixed) return false;
    if (report_.tiles < count) {
      throw Interrupted(fmt::format("stopped after {} of {} tiles; {}", report_.tiles, count,
                                    form_of(options_.output) == TileForm::kFolder
                                        ? "the folder has no layer.json yet"
                                        : "nothing is left of the output"));
    }
    output.close(layer_text);
    return true;
  }

  void count_in(const Tile& tile) {
    ++report_.tiles;
    report_.read_bytes += tile.read_bytes;
    report_.written_bytes += static_cast<std::int64_t>(tile.bytes->size());
    if (tile.is_repacked) ++report_.repacked_tiles;
    progress_.advance(1);
  }

  Tile tile_of(const TileKey& key, Change change) {
    Tile tile = {.bytes = input_.read(key)};
    if (!tile.bytes) return tile;
    tile.read_bytes = static_cast<std::int64_t>(tile.bytes->size());
    if (change == Change::kNone) return tile;
    auto plain = plain_tile_bytes(*tile.bytes);
    if (change == Change::kGzipPlainOnes && (!plain || *plain != *tile.bytes)) return tile;
    if (change == Change::kUnpack || !plain) {
      tile.is_repacked = !plain || *plain != *tile.bytes;
      tile.bytes = std::move(plain);
      return tile;
    }
    tile.is_repacked = true;
    std::optional<GzipCompressor>& compressor = compressors_.local();
    if (!compressor) {
      compressor.emplace(change == Change::kGzipAll ? options_.gzip_level : kLevelOfMixedSets);
    }
    tile.bytes = compressor->compress(*plain);
    return tile;
  }

  const TileSet& input_;
  const ConvertOptions& options_;
  Progress& progress_;
  std::vector<TileKey> keys_;
  Projection projection_ = Projection::kGeodetic;
  ConvertReport report_;
  tbb::enumerable_thread_specific<std::optional<GzipCompressor>> compressors_;
};

}  // namespace

ConvertReport convert(const TileSet& input, const ConvertOptions& options, Progress& progress) {
  return Converter(input, options, progress).run();
}

}  // namespace qmpipe
