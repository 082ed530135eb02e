#include "formats/heights/tally.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <mutex>
#include <optional>
#include <utility>

#include "formats/heights/judgement.h"
#include "formats/heights/rule.h"
#include "formats/heights/value_counts.h"

namespace qmpipe {
namespace {

struct TalliedSource {
  ValueCounts counts;
  std::vector<bool> blocks;
  HeightRule rule;
  std::string path;
};

// The same in any number of rasters.
struct ApartFinding {
  std::int64_t count = 0;
  std::int64_t of = 0;
  std::size_t rasters = 0;
  std::string first_path;
  std::string others;
};

std::string others_text(const ApartValues& apart, const HeightRule& rule) {
  if (std::isnan(apart.lowest_other)) return "there is no other value";
  return fmt::format("all others are {} to {}", value_text(apart.lowest_other, rule),
                     value_text(apart.highest_other, rule));
}

HeightFinding finding_of(const std::string& value, const ApartFinding& found,
                         const std::string& option) {
  const std::string more =
      found.rasters == 1 ? "" : fmt::format(" (of this raster and {} more)", found.rasters - 1);
  return {
      .path = found.first_path,
      .text = fmt::format("{} stands in {} of {} pixels{}, apart from the rest ({}); if it marks "
                          "voids: {}",
                          value, found.count, found.of, more, found.others, option)};
}

}  // namespace

struct HeightTally::Impl {
  mutable std::mutex mutex;
  std::map<std::uint32_t, TalliedSource> sources;
  std::mutex refusing;
  std::optional<IoError> refusal;
};

HeightTally::HeightTally(HeightGuard guard) : guard_(guard), impl_(std::make_unique<Impl>()) {}
HeightTally::~HeightTally() = default;

ValueCounts HeightTally::begin(std::uint32_t source) const {
  const std::scoped_lock lock(impl_->mutex);
  const auto found = impl_->sources.find(source);
  return found == impl_->sources.end() ? ValueCounts() : found->second.counts.begun();
}

bool HeightTally::knows(std::uint32_t source, std::int64_t block) const {
  const std::scoped_lock lock(impl_->mutex);
  const auto found = impl_->sources.find(source);
  const auto at = static_cast<std::size_t>(block);
  return found != impl_->sources.end() && at < found->second.blocks.size() &&
         found->second.blocks[at];
}

void HeightTally::add(std::uint32_t source, std::int64_t block, const ValueCounts& counts,
                      const HeightRule& rule, const std::string& path) {
  const std::scoped_lock lock(impl_->mutex);
  TalliedSource& tallied = impl_->sources[source];
  if (tallied.path.empty()) {
    tallied.rule = rule;
    tallied.path = path;
  }
  const auto at = static_cast<std::size_t>(block);
  if (at >= tallied.blocks.size()) tallied.blocks.resize(at + 1);
  // Two threads may have decoded it at once.
  if (tallied.blocks[at]) return;
  tallied.blocks[at] = true;
  tallied.counts.add(counts);
}

void HeightTally::refuse(const std::function<IoError()>& make) {
  const std::scoped_lock lock(impl_->refusing);
  if (!impl_->refusal) impl_->refusal = make();
  throw IoError(*impl_->refusal);
}

std::vector<HeightFinding> HeightTally::findings(const HeightOptions& given) const {
  const std::scoped_lock lock(impl_->mutex);
  std::map<std::pair<double, std::string>, ApartFinding> found;
  std::vector<double> values;
  for (const auto& [number, source] : impl_->sources) {
    const ApartValues apart = apart_values(source.counts, source.rule);
    for (const CountedValue& one : apart.values) {
      ApartFinding& same = found[{one.value, value_text(one.value, source.rule)}];
      if (same.rasters++ == 0) {
        same.first_path = source.path;
        same.others = others_text(apart, source.rule);
      }
      same.count += one.count;
      same.of += source.counts.count();
      const double typed = typed_value(one.value, source.rule);
      if (std::find(values.begin(), values.end(), typed) == values.end()) values.push_back(typed);
    }
  }
  // One option for all that was found.
  const std::string option = values.empty() ? "" : void_option(values, given);
  std::vector<HeightFinding> findings;
  for (const auto& [value, same] : found) {
    findings.push_back(finding_of(value.second, same, option));
  }
  return findings;
}

}  // namespace qmpipe
