// Looks at every value of the rasters of a run while they are read, so that what can be no height is
// found without another pass: heights that Earth does not have end the run, values that most likely
// mark voids are told.
//
// Guarantees: judged are a file's own pixels, not posts, which would spread a void value over their
// neighbours. Each block of a file is counted once, however often it is decoded; what was not read is
// not judged. Safe to use from several threads at once.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "formats/bytes/errors.h"
#include "formats/raster/height_options.h"

namespace qmpipe {

struct HeightRule;
class ValueCounts;

// What comes of heights that Earth does not have.
enum class HeightGuard { kStop, kAllow };

// About one raster, or about that and more that have the same; without a full stop.
struct HeightFinding {
  std::string path;
  std::string text;
};

class HeightTally {
 public:
  explicit HeightTally(HeightGuard guard);
  ~HeightTally();
  HeightTally(const HeightTally&) = delete;
  HeightTally& operator=(const HeightTally&) = delete;

  HeightGuard guard() const { return guard_; }

  // Of all that was read: values that stand apart, each once with how often and where, and the option
  // that would make all of them voids. `given`: what the rasters were read with.
  std::vector<HeightFinding> findings(const HeightOptions& given) const;

  // For RasterSource. A source is a raster's number; blocks are numbered as the caller likes.
  ValueCounts begin(std::uint32_t source) const;
  bool knows(std::uint32_t source, std::int64_t block) const;
  void add(std::uint32_t source, std::int64_t block, const ValueCounts& counts,
           const HeightRule& rule, const std::string& path);
  // Throws what `make` gives, which is called by one thread alone: the others throw the same.
  [[noreturn]] void refuse(const std::function<IoError()>& make);

 private:
  struct Impl;
  HeightGuard guard_;
  std::unique_ptr<Impl> impl_;
};

}  // namespace qmpipe
