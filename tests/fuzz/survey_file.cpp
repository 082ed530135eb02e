// Any bytes: parse_surveyed_zoom() neither throws nor over-reads. What it accepts is sorted and inside
// the scheme. The first byte is the zoom.
#include "formats/run_store/survey_file.h"

#include <cstdint>
#include <cstdlib>
#include <span>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) return 0;
  const std::int32_t zoom = data[0] % (qmpipe::kMaxZoom + 1);
  const qmpipe::TilingScheme scheme(qmpipe::Projection::kGeodetic);
  const auto surveyed = qmpipe::parse_surveyed_zoom(std::span(data, size).subspan(1), zoom, scheme);
  if (!surveyed.ok()) return 0;
  const qmpipe::SurveyedTile* last = nullptr;
  for (const qmpipe::SurveyedTile& tile : surveyed->tiles) {
    if (!scheme.contains(tile.key) || (last != nullptr && !(last->key < tile.key))) std::abort();
    last = &tile;
  }
  return 0;
}
