// What `check` finds at a tile set on a web server: faults, which keep viewers from showing it (or
// parts of it); warnings, which trouble some viewers or pages; hints, which cost something only.
//
// Guarantees: every kind has a stable name, what a viewer shows because of it, and a remedy. Equal
// findings of many tiles are one finding with a count.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace qmpipe::web_check {

enum class CheckSeverity : std::uint8_t { kFault, kWarning, kHint };

enum class CheckKind : std::uint8_t {
  // The server.
  kNoAnswer,
  kMixedContent,
  kHttpOnly,
  kNoCors,
  kCorsOtherOrigin,
  kCorsTwice,
  // How any answer is sent.
  kCutOff,
  kGzipNotAnnounced,
  kGzipAnnounced,       // but the bytes are plain
  kGzipTwice,           // announced once
  kGzipTwiceAnnounced,  // so that browsers undo both
  kGzipDamaged,
  kForeignEncoding,
  // layer.json.
  kLayerMissing,
  kLayerStatus,
  kLayerHtml,
  kLayerUnreadable,
  kMisspeltKey,
  kFormat,
  kNoTileUrls,
  kTileUrl,
  kNoVersion,
  kScheme,
  kSchemeNotTms,
  kNoAvailability,
  kAvailableEmpty,
  kAvailableRoots,
  kAvailableRange,
  kAvailableHole,
  kManyRanges,
  kDeeperNotChecked,
  kMaxZoomLow,
  kNoMaxZoom,
  kAvailableIgnored,
  kMetadataLevels,
  kUnknownExtension,
  kParentNotChecked,
  // Tiles.
  kTileNoAnswer,
  kRootMissing,
  kTileMissing,
  kTileEmpty,
  kTileHtml,
  kTileUnreadable,
  kVertexCount,  // exactly 65,536
  kMetadataUnexpected,
  kMetadataAbsent,
  kMetadataUnreadable,
  kNormalsNotListed,
  kNormalsAbsent,
  kWaterMaskNotListed,
  kWaterMaskAbsent,
  kTileMisplaced,
  kRowsFlipped,
  kMediaType,
  kMediaTypeGeneric,
  // What costs something only.
  kNoCaching,
  kSoft404,
  kUnlistedTile,
  kHeadRefused,
  kTileRedirect,
};
inline constexpr std::size_t kCheckKinds = static_cast<std::size_t>(CheckKind::kTileRedirect) + 1;

struct CheckKindText {
  CheckKind kind;
  const char* name;  // lower-case words joined by hyphens: "gzip-not-announced"
  CheckSeverity severity;
  const char* viewer;  // what a viewer shows or does
  const char* remedy;
};
const CheckKindText& text_of(CheckKind kind);
const char* name_of(CheckSeverity severity);

enum class CheckSubject : std::uint8_t { kLayer, kTile };

struct CheckFinding {
  CheckKind kind = CheckKind::kNoAnswer;
  CheckSeverity severity = CheckSeverity::kFault;
  CheckSubject subject = CheckSubject::kLayer;
  std::string url;         // the first answer that shows it
  std::string text;        // what was found there, no full stop
  std::int64_t count = 1;  // answers that show it
};

class CheckLog {
 public:
  // With the kind's own severity, or another one where it depends on more than the kind.
  void add(CheckKind kind, CheckSubject subject, const std::string& url, const std::string& text);
  void add(CheckFinding finding);

  bool has(CheckKind kind) const;
  // Answers with a fault, counted once for each fault.
  std::int64_t faulty_answers() const;
  // Faults first, then warnings, then hints; within them by kind, in the order of their coming.
  std::vector<CheckFinding> sorted() const;

 private:
  std::vector<CheckFinding> findings_;
};

}  // namespace qmpipe::web_check
