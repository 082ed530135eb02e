// What `verify` finds: faults, which break a promise of the format or of a crack-free pyramid, and
// warnings, which are legal but cost something or could not be judged.
//
// Guarantees: every kind has a stable name, which scripts may rely on. A FindingLog counts every
// finding but keeps only the first ones of each kind, so that a set with millions of faults needs
// no memory for their texts.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "scheduler/tile_key.h"

namespace qmpipe {

enum class FindingKind : std::uint8_t {
  // The set: layer.json against the files.
  kLayerJson,           // cannot be read, or says something wrong
  kUnlistedTile,        // a file that `available` does not list
  kMissingFile,         // listed in `available`, but there is no file
  kMissingRoot,         // a root is neither there nor listed
  kMissingParent,       // a tile's parent is neither there nor listed
  kOutsideScheme,       // a tile beyond the scheme's columns or rows
  kStrayFile,           // a file that looks like a tile and can be none
  kExtensionNotListed,  // in the tiles, but not in "extensions"
  kExtensionAbsent,     // in "extensions", but not in the tiles
  kMetadata,            // extension 4 where it must not be, or not where it must be
  // One tile.
  kUnreadableTile,
  kVertexCount,  // exactly 65,536
  kClockwiseTriangle,
  kDegenerateTriangle,
  kRepeatedEdge,  // two triangles on the same side of an edge: they overlap
  kOpenEdge,  // an edge inside the square with a triangle on one side only: a hole, a T-junction
  kArea,      // the triangles' areas do not add up to the square
  kMissingCorner,
  kSideList,
  kUnusedVertex,
  kDuplicateVertex,
  kHeightRange,
  kBoundingSphere,
  kOcclusionPoint,
  kHiddenTerrain,  // a camera that sees a vertex, from where clients leave the tile out
  kCentre,
  kNormalIntoGround,
  // Two tiles.
  kBorderVertices,  // neighbours have different vertices on their common side
  kCrack,           // the same vertices, more than 1 mm apart
  kBorderNormals,
  // The source.
  kMissingTile,         // the source has data there, the set has no tile
  kTolerance,           // a post farther from the surface than its zoom's tolerance
  kCliffOutside,        // outside the data, a slope that the data do not explain
  kLevelsApartOutside,  // there, a tile that is not its parent's surface
  // Warnings.
  kNotChecked,
  kLayerJsonAdvice,
  kOversizedSphere,
  kLooseHeightRange,
  kOcclusionIgnored,  // a wrong occlusion point that clients do not read
  kPartialWaterMask,
};
inline constexpr std::size_t kFindingKinds =
    static_cast<std::size_t>(FindingKind::kPartialWaterMask) + 1;

enum class Severity : std::uint8_t { kFault, kWarning };

// Lower-case words joined by hyphens: "clockwise-triangle".
const char* name_of(FindingKind kind);
Severity severity_of(FindingKind kind);

struct Finding {
  FindingKind kind = FindingKind::kLayerJson;
  std::optional<TileKey> key;  // none: layer.json or the set as a whole
  std::string text;            // with the numbers, no full stop
  friend bool operator==(const Finding&, const Finding&) = default;
};

// "12/3/4", or "layer.json" where there is no key.
std::string place_of(const Finding& finding);

class FindingLog {
 public:
  // Keeps at most `most_per_kind` findings of each kind: the first ones added.
  explicit FindingLog(std::int64_t most_per_kind) : most_per_kind_(most_per_kind) {}

  void add(Finding finding);
  void add_all(std::vector<Finding> findings);

  // All that were added, kept or not.
  std::int64_t count(FindingKind kind) const { return counts_[static_cast<std::size_t>(kind)]; }
  std::int64_t total(Severity severity) const;
  // The kept ones, layer.json first, then by key, then by kind.
  std::vector<Finding> sorted(Severity severity) const;

 private:
  std::int64_t most_per_kind_;
  std::array<std::int64_t, kFindingKinds> counts_{};
  std::vector<Finding> kept_;
};

}  // namespace qmpipe
