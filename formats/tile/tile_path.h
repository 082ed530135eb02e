// The name of a tile in a folder: {z}/{x}/{y}.terrain.
#pragma once

#include <charconv>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "scheduler/tile_key.h"

namespace qmpipe {

inline constexpr std::string_view kTileExtension = ".terrain";

// "0", "17": decimal digits without sign or leading zeros, as tile servers ask for them.
inline std::optional<std::int32_t> parse_tile_number(std::string_view text) {
  std::int32_t value = 0;
  if (text.empty() || text[0] == '-' || (text.size() > 1 && text[0] == '0')) return std::nullopt;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

// The key in a path's last three parts; none when they are no tile's name. The scheme's limits are
// not looked at.
inline std::optional<TileKey> parse_tile_path(const std::filesystem::path& path) {
  if (path.extension() != kTileExtension) return std::nullopt;
  const std::filesystem::path x_folder = path.parent_path();
  const auto y = parse_tile_number(path.stem().string());
  const auto x = parse_tile_number(x_folder.filename().string());
  const auto zoom = parse_tile_number(x_folder.parent_path().filename().string());
  if (!y || !x || !zoom) return std::nullopt;
  return TileKey{.zoom = *zoom, .x = *x, .y = *y};
}

inline std::string tile_file_name(const TileKey& key) {
  return to_string(key) + std::string(kTileExtension);
}

}  // namespace qmpipe
