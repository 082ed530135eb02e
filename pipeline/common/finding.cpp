#include "pipeline/common/finding.h"

#include <algorithm>
#include <tuple>

namespace qmpipe {

const char* name_of(FindingKind kind) {
  constexpr std::array<const char*, kFindingKinds> kNames = {"layer-json",
                                                             "unlisted-tile",
                                                             "missing-file",
                                                             "missing-root",
                                                             "missing-parent",
                                                             "outside-scheme",
                                                             "stray-file",
                                                             "extension-not-listed",
                                                             "extension-absent",
                                                             "metadata",
                                                             "unreadable-tile",
                                                             "forbidden-vertex-count",
                                                             "clockwise-triangle",
                                                             "degenerate-triangle",
                                                             "repeated-edge",
                                                             "open-edge",
                                                             "area",
                                                             "missing-corner",
                                                             "side-list",
                                                             "unused-vertex",
                                                             "duplicate-vertex",
                                                             "height-range",
                                                             "bounding-sphere",
                                                             "occlusion-point",
                                                             "hidden-terrain",
                                                             "centre",
                                                             "normal-into-ground",
                                                             "border-vertices",
                                                             "crack",
                                                             "border-normals",
                                                             "missing-tile",
                                                             "tolerance",
                                                             "cliff-outside",
                                                             "levels-apart-outside",
                                                             "not-checked",
                                                             "layer-json-advice",
                                                             "oversized-sphere",
                                                             "loose-height-range",
                                                             "occlusion-ignored",
                                                             "partial-water-mask"};
  return kNames.at(static_cast<std::size_t>(kind));
}

Severity severity_of(FindingKind kind) {
  return kind < FindingKind::kNotChecked ? Severity::kFault : Severity::kWarning;
}

std::string place_of(const Finding& finding) {
  return finding.key ? to_string(*finding.key) : "layer.json";
}

void FindingLog::add(Finding finding) {
  if (++counts_[static_cast<std::size_t>(finding.kind)] > most_per_kind_) return;
  kept_.push_back(std::move(finding));
}

void FindingLog::add_all(std::vector<Finding> findings) {
  for (Finding& finding : findings) add(std::move(finding));
}

std::int64_t FindingLog::total(Severity severity) const {
  std::int64_t total = 0;
  for (std::size_t k = 0; k < kFindingKinds; ++k) {
    if (severity_of(static_cast<FindingKind>(k)) == severity) total += counts_[k];
  }
  return total;
}

std::vector<Finding> FindingLog::sorted(Severity severity) const {
  std::vector<Finding> findings;
  std::copy_if(kept_.begin(), kept_.end(), std::back_inserter(findings),
               [severity](const Finding& f) { return severity_of(f.kind) == severity; });
  std::stable_sort(findings.begin(), findings.end(), [](const Finding& a, const Finding& b) {
    return std::tie(a.key, a.kind) < std::tie(b.key, b.kind);
  });
  return findings;
}

}  // namespace qmpipe
