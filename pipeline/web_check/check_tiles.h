// The tiles that `check` asks a server for, and what their answers show.
//
// One object, one thread. Gives up after a few tiles without any answer, so that a server that
// hangs costs a few timeouts and not one for each tile.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "formats/tile/quantized_mesh.h"
#include "pipeline/web_check/check_answer.h"
#include "pipeline/web_check/check_layer.h"
#include "pipeline/web_check/check_tile_answer.h"

namespace qmpipe::web_check {

// Asks as a browser would for a page.
struct Asker {
  AskingPage page;
  const Fetch& fetch;

  Result<HttpAnswer> get(const WebAddress& address, const std::string& accept,
                         std::size_t limit_bytes) const;
  Result<HttpAnswer> head(const WebAddress& address, const std::string& accept) const;
};

class TileCheck {
 public:
  // REQUIRES: a usable layer. All four are kept as references.
  TileCheck(const ServedLayer& layer, const WebAddress& folder, const Asker& asker, CheckLog& log);

  // Sets with "available".
  void ask_for_sample(std::size_t limit);
  // Sets with "metadataAvailability": from the roots down, by what the tiles say lies below them.
  void walk_down(std::size_t limit);
  // A tile below the deepest zoom: what is no tile must not be answered as one.
  void ask_for_unlisted();
  // Of a tile that could be read.
  void ask_for_head();

  std::int64_t asked() const { return asked_; }
  // Those that decode, and those without any fault.
  std::int64_t read() const { return read_; }
  std::int64_t sound() const { return sound_; }
  std::int32_t deepest_zoom() const { return deepest_zoom_; }
  bool has_water_mask() const { return has_water_mask_; }

 private:
  void add(CheckKind kind, const std::string& url, const std::string& text);
  bool has_given_up() const;
  std::optional<QuantizedMesh> ask_for(const TileKey& key);
  std::optional<QuantizedMesh> look_at_tile(const TileKey& key, const HttpAnswer& answer);
  void look_for_unlisted_parents(const TileKey& key);
  void look_at_missing(const TileKey& key, const HttpAnswer& answer);
  bool lies_at_mirrored_name(const TileKey& key);
  void look_at_place(const TileKey& key, const QuantizedMesh& mesh, const std::string& url);
  void add_flipped(const std::string& url, const std::string& text);
  std::vector<std::vector<TileRange>> ranges_below(const TileKey& key, const std::string& json);

  const ServedLayer& layer_;
  const WebAddress& folder_;
  const Asker& asker_;
  CheckLog& log_;
  std::string accept_;
  std::int64_t asked_ = 0;
  std::int64_t read_ = 0;
  std::int64_t sound_ = 0;
  std::int32_t deepest_zoom_ = 0;
  bool has_water_mask_ = false;
  int unanswered_ = 0;
  int vain_mirrored_names_ = 0;
  std::optional<TileKey> first_read_;
};

}  // namespace qmpipe::web_check
