// Borders for the tests of border stores.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "formats/bytes/file_bytes.h"
#include "formats/hdf5/segment_files.h"
#include "formats/run_store/border_chunk.h"
#include "formats/run_store/hdf5_border_store.h"

namespace qmpipe::testing {

// Dense, sparse, only corners, or full: different for most seeds.
inline BorderMask mask_of_seed(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  BorderMask mask;
  mask.set(0);
  mask.set(kTileIntervals);
  const std::uint64_t one_in = seed % 16 == 0 ? 1000 : 1 + random() % 12;
  for (std::int32_t k = 0; k <= kTileIntervals; ++k) {
    if (random() % one_in == 0) mask.set(k);
  }
  return mask;
}

// 64 x 32 tiles with four sides each. REQUIRES: 0 <= n < 8192.
inline BorderKey border_of_number(std::int32_t n) {
  return {.owner = {.zoom = 5, .x = (n / 4) % 64, .y = n / 256},
          .side = kSides.at(static_cast<std::size_t>(n % 4))};
}
inline constexpr std::int32_t kBorderNumbers = 8192;

inline void publish(BorderStore& store, std::int32_t n, const BorderMask& mask) {
  const BorderKey key = border_of_number(n);
  store.publish(key.owner, key.side, mask);
}

inline BorderMask take(BorderStore& store, std::int32_t n) {
  const BorderKey key = border_of_number(n);
  return store.take(key.owner, key.side);
}

// What a store should hold.
using BorderModel = std::map<std::int32_t, BorderMask>;

inline std::unique_ptr<BorderStore> open_borders(const std::filesystem::path& folder,
                                                 const Hdf5BorderOptions& options) {
  auto store = open_hdf5_border_store(folder, TilingScheme(Projection::kGeodetic), options);
  if (!store) throw std::runtime_error(store.error().message);
  return std::move(*store);
}

inline std::filesystem::path border_segment_path(const std::filesystem::path& folder,
                                                 std::int32_t number) {
  return segment_path(folder, SegmentKind::kBorders, number);
}

// Empty when the folder opens.
inline std::string error_of_opening(const std::filesystem::path& folder,
                                    Projection projection = Projection::kGeodetic,
                                    std::int32_t max_zoom = 5) {
  const auto store =
      open_hdf5_border_store(folder, TilingScheme(projection), {.max_zoom = max_zoom});
  return store ? "" : store.error().message;
}

inline std::vector<std::uint8_t> bytes_of(const std::filesystem::path& path) {
  return read_file_bytes(path, std::size_t{1} << 30U).value();
}

// Borders first, first + step, ... below end, into the store and the model.
inline void publish_some(BorderStore& store, BorderModel& model, std::int32_t first,
                         std::int32_t end, std::int32_t step = 1) {
  for (std::int32_t n = first; n < end; n += step) {
    publish(store, n, model[n] = mask_of_seed(static_cast<std::uint64_t>(n)));
  }
}

// A folder with one segment of `count` borders.
inline BorderModel make_segment(const std::filesystem::path& folder, std::int32_t count) {
  BorderModel model;
  const auto store = open_borders(folder, {.max_zoom = 5});
  publish_some(*store, model, 0, 3 * count, 3);
  store->seal();
  return model;
}

inline void expect_all(BorderStore& store, const BorderModel& model) {
  for (const auto& [n, mask] : model) {
    ASSERT_EQ(take(store, n), mask) << to_string(border_of_number(n));
  }
}

}  // namespace qmpipe::testing
