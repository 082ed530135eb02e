#include "pipeline/convert/diff_layer.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "formats/tile/layer_json.h"

namespace qmpipe {
namespace {

// Keys sorted, so that their order does not count.
using ParsedJson = nlohmann::json;

constexpr std::size_t kLongestValue = 72;
constexpr const char* kAbsent = "absent";

std::string text_of(const ParsedJson* value) {
  if (value == nullptr) return kAbsent;
  std::string text = value->dump(-1, ' ', true, ParsedJson::error_handler_t::replace);
  // ASCII only, so that no character is cut in two.
  if (text.size() > kLongestValue) text = text.substr(0, kLongestValue) + "...";
  return text;
}

const ParsedJson* find(const ParsedJson& object, const std::string& key) {
  const auto found = object.find(key);
  return found == object.end() ? nullptr : &*found;
}

class Comparer {
 public:
  void compare(const std::string& path, const ParsedJson* a, const ParsedJson* b) {
    if (a != nullptr && b != nullptr && *a == *b) return;
    if (a != nullptr && b != nullptr && a->is_object() && b->is_object()) {
      compare_objects(path, *a, *b);
    } else if (a != nullptr && b != nullptr && path == "available" && a->is_array() &&
               b->is_array()) {
      compare_lists(path, *a, *b);
    } else {
      differences_.push_back({.key = path, .a = text_of(a), .b = text_of(b)});
    }
  }
  std::vector<LayerDifference> take() { return std::move(differences_); }

 private:
  void compare_objects(const std::string& path, const ParsedJson& a, const ParsedJson& b) {
    std::set<std::string> keys;
    for (const ParsedJson* object : {&a, &b}) {
      for (const auto& item : object->items()) keys.insert(item.key());
    }
    for (const std::string& key : keys) {
      compare(path.empty() ? key : fmt::format("{}.{}", path, key), find(a, key), find(b, key));
    }
  }

  void compare_lists(const std::string& path, const ParsedJson& a, const ParsedJson& b) {
    for (std::size_t k = 0; k < std::max(a.size(), b.size()); ++k) {
      compare(fmt::format("{}[{}]", path, k), k < a.size() ? &a[k] : nullptr,
              k < b.size() ? &b[k] : nullptr);
    }
  }

  std::vector<LayerDifference> differences_;
};

// Why it is none that can be compared by its keys; empty where it can. Its depth is bounded, too.
std::string fault_of(const Result<std::string>& text) {
  if (!text) return text.error().message;
  const auto parsed = parse_layer_json(*text);
  return parsed ? "" : parsed.error().message;
}

}  // namespace

std::vector<LayerDifference> differences_of_layers(const Result<std::string>& a,
                                                   const Result<std::string>& b) {
  if (a.ok() == b.ok() && (!a.ok() || *a == *b)) return {};
  const std::string fault_a = fault_of(a);
  const std::string fault_b = fault_of(b);
  if (!fault_a.empty() || !fault_b.empty()) {
    const auto words = [](const std::string& fault) { return fault.empty() ? "readable" : fault; };
    return {{.key = "layer.json", .a = words(fault_a), .b = words(fault_b)}};
  }
  Comparer comparer;
  const ParsedJson json_a = ParsedJson::parse(*a);
  const ParsedJson json_b = ParsedJson::parse(*b);
  comparer.compare("", &json_a, &json_b);
  return comparer.take();
}

}  // namespace qmpipe
