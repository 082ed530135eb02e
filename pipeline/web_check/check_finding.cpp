#include "pipeline/web_check/check_finding.h"

#include <algorithm>
#include <tuple>

#include "pipeline/web_check/check_texts.h"
#include "pipeline/web_check/web_address.h"
#include "scheduler/check.h"

namespace qmpipe::web_check {

const CheckKindText& text_of(CheckKind kind) {
  const CheckKindText& text = kCheckTexts.at(static_cast<std::size_t>(kind));
  QMPIPE_CHECK(text.kind == kind);
  return text;
}

const char* name_of(CheckSeverity severity) {
  switch (severity) {
    case CheckSeverity::kFault:
      return "fault";
    case CheckSeverity::kWarning:
      return "warning";
    case CheckSeverity::kHint:
      return "hint";
  }
  return "";
}

void CheckLog::add(CheckKind kind, CheckSubject subject, const std::string& url,
                   const std::string& text) {
  add({.kind = kind,
       .severity = text_of(kind).severity,
       .subject = subject,
       .url = url,
       .text = text});
}

void CheckLog::add(CheckFinding finding) {
  // Reports are shown and kept: whatever is in them passes here.
  finding.url = without_credentials(finding.url);
  finding.text = without_credentials(finding.text);
  // Tiles that suffer alike are told once; layer.json may have several faults of a kind.
  const auto is_equal = [&finding](const CheckFinding& other) {
    return other.kind == finding.kind && other.subject == finding.subject &&
           (finding.subject == CheckSubject::kTile || other.text == finding.text);
  };
  const auto same = std::find_if(findings_.begin(), findings_.end(), is_equal);
  if (same == findings_.end()) {
    findings_.push_back(std::move(finding));
  } else {
    same->count += finding.count;
  }
}

bool CheckLog::has(CheckKind kind) const {
  return std::any_of(findings_.begin(), findings_.end(),
                     [kind](const CheckFinding& finding) { return finding.kind == kind; });
}

std::int64_t CheckLog::faulty_answers() const {
  std::int64_t answers = 0;
  for (const CheckFinding& finding : findings_) {
    if (finding.severity == CheckSeverity::kFault) answers += finding.count;
  }
  return answers;
}

std::vector<CheckFinding> CheckLog::sorted() const {
  std::vector<CheckFinding> findings = findings_;
  std::stable_sort(
      findings.begin(), findings.end(), [](const CheckFinding& a, const CheckFinding& b) {
        return std::tie(a.severity, a.kind, a.subject) < std::tie(b.severity, b.kind, b.subject);
      });
  return findings;
}

}  // namespace qmpipe::web_check
