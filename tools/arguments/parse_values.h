// Values on the command line that are more than a number: sizes, levels, lists of zoom=value.
// All throw UsageError with the option's name and what would be right.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "formats/bytes/errors.h"
#include "formats/bytes/result.h"
#include "formats/tile/mesh_export.h"

namespace qmpipe {

// The value, or a UsageError that names the option.
template <class Value>
Value understood(const char* option, const Result<Value>& value) {
  if (!value) throw UsageError(std::string(option) + ": " + value.error().message);
  return *value;
}

// "2G", "512M", "65536": bytes; K, M, G, T are powers of 1024, a following "B" or "iB" is allowed.
std::int64_t parse_size(const std::string& option, const std::string& text);

// "none" or 1..12.
std::optional<int> parse_gzip(const std::string& text);

// "8=20,9=10.5": a tolerance in metres for each zoom.
std::map<std::int32_t, double> parse_tolerances(const std::string& text);

// --frame, "local" or "crs", of a mesh to be written: whether it is local, which those of 32-bit floats
// have to be.
bool is_local_frame(const std::string& frame, MeshFormat format);

}  // namespace qmpipe
