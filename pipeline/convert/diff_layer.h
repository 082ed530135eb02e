// What differs between two layer.json, key by key; white space and the order of keys do not count.
#pragma once

#include <string>
#include <vector>

#include "formats/bytes/result.h"

namespace qmpipe {

struct LayerDifference {
  // "attribution", "qmpipe.threads", "available[7]"; "layer.json" where one as a whole is missing or
  // cannot be read.
  std::string key;
  // The values as JSON, long ones cut short; "absent"; for a whole file, words.
  std::string a;
  std::string b;
};

// Sorted by key, except that list items stay in order. Files that cannot be read as a layer.json
// are compared by their bytes. Two missing ones do not differ.
std::vector<LayerDifference> differences_of_layers(const Result<std::string>& a,
                                                   const Result<std::string>& b);

}  // namespace qmpipe
