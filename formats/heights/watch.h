// Shows a raster's values to a HeightTally as they are read. For formats/ only.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <utility>

#include "formats/heights/rule.h"
#include "formats/heights/tally.h"
#include "formats/heights/value_counts.h"
#include "formats/raster/reader.h"

namespace qmpipe {

class HeightWatch final : public BlockWatcher {
 public:
  // `rule`, `info` and `given` outlive it.
  HeightWatch(std::shared_ptr<HeightTally> tally, std::uint32_t source, const HeightRule& rule,
              const RasterInfo& info, const HeightOptions& given)
      : tally_(std::move(tally)), source_(source), rule_(rule), info_(info), given_(given) {}

  bool wants(std::int64_t block) override;
  void see(std::span<double> values) override;
  // Throws IoError when there are heights that Earth does not have, and the tally does not allow them:
  // then the raster is looked at as a whole first, so that the remedy is one for all of it.
  void done(std::int64_t block, const RasterReader& reader) override;

 private:
  IoError refusal(const RasterReader& reader) const;

  std::shared_ptr<HeightTally> tally_;
  std::uint32_t source_;
  const HeightRule& rule_;
  const RasterInfo& info_;
  const HeightOptions& given_;
  ValueCounts counts_;
};

}  // namespace qmpipe
