#include "formats/heights/watch.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "formats/bytes/errors.h"
#include "formats/heights/judgement.h"

namespace qmpipe {
namespace {

constexpr std::int64_t kPixelsAtOnce = 4'000'000;
// Some seconds' worth; of a larger raster as much, spread over it.
constexpr std::int64_t kMostPixels = 200'000'000;

// Calls see(values) for strips of raw values, voids NaN.
template <class See>
void look_at(const RasterReader& reader, const HeightRule& rule, const RasterInfo& info,
             const See& see) {
  const std::int64_t rows_at_once =
      std::clamp<std::int64_t>(kPixelsAtOnce / info.width, 1, info.height);
  const std::int64_t strips = (info.height + rows_at_once - 1) / rows_at_once;
  const std::int64_t step = 1 + strips * rows_at_once * info.width / kMostPixels;
  std::vector<double> values;
  std::vector<std::uint8_t> mask;
  for (std::int64_t strip = 0; strip < strips; strip += step) {
    PixelWindow window{.row0 = strip * rows_at_once, .width = info.width};
    window.height = std::min(rows_at_once, info.height - window.row0);
    values.resize(window.size());
    mask.resize(rule.has_mask ? window.size() : 0);
    reader.read_past_cache(window, values, mask);
    for (std::size_t k = 0; k < mask.size(); ++k) {
      if (mask[k] == 0) values[k] = std::numeric_limits<double>::quiet_NaN();
    }
    rule.mark_voids(values);
    see(values);
  }
}

}  // namespace

bool HeightWatch::wants(std::int64_t block) {
  if (tally_->knows(source_, block)) return false;
  counts_ = tally_->begin(source_);
  return true;
}

void HeightWatch::see(std::span<double> values) {
  rule_.mark_voids(values);
  counts_.add(values);
}

void HeightWatch::done(std::int64_t block, const RasterReader& reader) {
  tally_->add(source_, block, counts_, rule_, info_.path);
  if (tally_->guard() == HeightGuard::kStop && is_beyond_earth(counts_, rule_)) {
    tally_->refuse([&] { return refusal(reader); });
  }
}

IoError HeightWatch::refusal(const RasterReader& reader) const {
  ValueCounts counts;
  OutsideCounts outside(rule_);
  look_at(reader, rule_, info_, [&](std::span<const double> values) {
    counts.add(values);
    outside.add(values);
  });
  if (!is_beyond_earth(counts, rule_)) {
    // What was seen lies between the strips.
    counts.add(counts_);
    outside.add(counts_);
  }
  const HeightRefusal refusal = refusal_of(counts, outside, rule_, given_);
  return {"cannot take the heights of", info_.path, refusal.cause, refusal.remedy};
}

}  // namespace qmpipe
