#include "formats/raster/height_unit.h"

#include <array>
#include <cctype>
#include <string>

namespace qmpipe {
namespace {

struct Unit {
  std::string_view name;
  double metres;
};

constexpr double kFootM = 0.3048;
constexpr double kUsFootM = 1200.0 / 3937.0;

constexpr std::array<Unit, 22> kUnits = {{{"", 1},
                                          {"m", 1},
                                          {"metre", 1},
                                          {"meter", 1},
                                          {"mm", 1e-3},
                                          {"millimetre", 1e-3},
                                          {"millimeter", 1e-3},
                                          {"cm", 1e-2},
                                          {"centimetre", 1e-2},
                                          {"centimeter", 1e-2},
                                          {"dm", 1e-1},
                                          {"decimetre", 1e-1},
                                          {"decimeter", 1e-1},
                                          {"km", 1e3},
                                          {"kilometre", 1e3},
                                          {"kilometer", 1e3},
                                          {"ft", kFootM},
                                          {"feet", kFootM},
                                          {"foot", kFootM},
                                          {"fathom", 1.8288},
                                          {"yard", 0.9144},
                                          {"yd", 0.9144}}};

std::optional<double> metres_of(std::string_view name) {
  if (name.size() > 2 && name.back() == 's') name.remove_suffix(1);
  for (const Unit& unit : kUnits) {
    if (unit.name == name) return unit.metres;
  }
  return std::nullopt;
}

bool cut(std::string& text, std::string_view part) {
  const std::size_t at = text.find(part);
  if (at == std::string::npos) return false;
  text.erase(at, part.size());
  return true;
}

bool is_foot(std::string_view name) { return name == "ft" || name == "feet" || name == "foot"; }

// "US_survey_foot", "Feet (US Survey)", "ftUS", "sft": a foot with words around it, in any order.
std::optional<double> metres_of_foot(std::string name) {
  const bool is_international = cut(name, "international") || cut(name, "intl");
  const bool is_survey = cut(name, "survey");
  if (is_international)
    return is_foot(name) || name == "ift" ? std::optional(kFootM) : std::nullopt;
  if (name == "ift") return kFootM;
  if (is_survey && is_foot(name)) return kUsFootM;
  if (cut(name, "unitedstates") || cut(name, "us")) {
    return is_foot(name) || name == "sft" ? std::optional(kUsFootM) : std::nullopt;
  }
  return name == "sft" ? std::optional(kUsFootM) : std::nullopt;
}

}  // namespace

std::optional<double> metres_per_unit(std::string_view name) {
  std::string plain;
  bool has_other = false;
  for (const char c : name) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalpha(byte) != 0) plain += static_cast<char>(std::tolower(byte));
    has_other = has_other || std::isdigit(byte) != 0 || byte >= 128 || c == '/';
  }
  // "m2", "m/s" are not heights.
  if (has_other) return std::nullopt;
  const std::optional<double> known = metres_of(plain);
  return known ? known : metres_of_foot(plain);
}

}  // namespace qmpipe
