#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "formats/bytes/printable.h"
#include "pipeline/common/text_table.h"
#include "pipeline/web_check/check_url.h"

namespace qmpipe::web_check {
namespace {

// What viewers do, and the remedy, once for all findings of a kind.
enum class Advice { kShown, kShownAfter };

std::string text_of_finding(const CheckFinding& finding, Advice advice) {
  const CheckKindText& about = text_of(finding.kind);
  const std::string more =
      finding.count > 1 ? fmt::format(" ({} answers, the first is this one)", finding.count) : "";
  std::string text =
      fmt::format("{} {}: {}\n  at      {}{}\n", name_of(finding.severity), about.name,
                  printable_line(finding.text), printable_line(finding.url), more);
  if (advice == Advice::kShown) {
    text += fmt::format("  viewers {}\n  remedy  {}\n", about.viewer, about.remedy);
  }
  return text;
}

}  // namespace

std::int64_t CheckReport::count(CheckSeverity severity) const {
  return std::count_if(findings.begin(), findings.end(), [severity](const CheckFinding& finding) {
    return finding.severity == severity;
  });
}

std::string text_of(const CheckReport& report) {
  std::string text;
  for (std::size_t k = 0; k < report.findings.size(); ++k) {
    const bool is_last_of_kind =
        k + 1 == report.findings.size() || report.findings[k + 1].kind != report.findings[k].kind;
    text +=
        text_of_finding(report.findings[k], is_last_of_kind ? Advice::kShown : Advice::kShownAfter);
  }
  text += fmt::format("check: {}: {} of {} without a fault", printable_line(report.layer_url),
                      grouped(report.tiles_sound), counted(report.tiles_asked, "tile"));
  if (report.deepest_zoom > 0) text += fmt::format(", down to zoom {}", report.deepest_zoom);
  for (const CheckSeverity severity :
       {CheckSeverity::kFault, CheckSeverity::kWarning, CheckSeverity::kHint}) {
    text += ", " + counted(report.count(severity), name_of(severity));
  }
  return text + "\n";
}

std::string json_of(const CheckReport& report) {
  using Json = nlohmann::ordered_json;
  Json findings = Json::array();
  for (const CheckFinding& finding : report.findings) {
    const CheckKindText& about = text_of(finding.kind);
    findings.push_back({{"code", about.name},
                        {"severity", name_of(finding.severity)},
                        {"url", finding.url},
                        {"answers", finding.count},
                        {"text", finding.text},
                        {"viewers", about.viewer},
                        {"remedy", about.remedy}});
  }
  const Json json = {{"layer_json", report.layer_url},
                     {"answered", report.is_answered},
                     {"tiles_asked", report.tiles_asked},
                     {"tiles_sound", report.tiles_sound},
                     {"deepest_zoom", report.deepest_zoom},
                     {"fault_count", report.count(CheckSeverity::kFault)},
                     {"warning_count", report.count(CheckSeverity::kWarning)},
                     {"hint_count", report.count(CheckSeverity::kHint)},
                     {"findings", findings}};
  // Texts may quote bytes of a damaged layer.json.
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace qmpipe::web_check
