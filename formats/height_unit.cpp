#include "formats/height_unit.h"

#include <array>
#include <cctype>
#include <string>

namespace qmpipe {
namespace {

struct Unit {
  std::string_view name;
  double metres;
};

constexpr double kUsFootM = 1200.0 / 3937.0;

// Letters only and in lower case, because files write "US_survey_foot", "us-ft", "Foot (US)".
constexpr std::array<Unit, 46> kUnits = {{
    {"", 1},
    {"m", 1},
    {"metre", 1},
    {"metres", 1},
    {"meter", 1},
    {"meters", 1},
    {"mm", 1e-3},
    {"millimetre", 1e-3},
    {"millimetres", 1e-3},
    {"millimeter", 1e-3},
    {"millimeters", 1e-3},
    {"cm", 1e-2},
    {"centimetre", 1e-2},
    {"centimetres", 1e-2},
    {"centimeter", 1e-2},
    {"centimeters", 1e-2},
    {"dm", 1e-1},
    {"decimetre", 1e-1},
    {"decimetres", 1e-1},
    {"decimeter", 1e-1},
    {"decimeters", 1e-1},
    {"km", 1e3},
    {"kilometre", 1e3},
    {"kilometres", 1e3},
    {"kilometer", 1e3},
    {"kilometers", 1e3},
    {"ft", 0.3048},
    {"feet", 0.3048},
    {"foot", 0.3048},
    {"ift", 0.3048},
    {"internationalfoot", 0.3048},
    {"internationalfeet", 0.3048},
    {"footinternational", 0.3048},
    {"feetinternational", 0.3048},
    {"usft", kUsFootM},
    {"ftus", kUsFootM},
    {"ussurveyfoot", kUsFootM},
    {"ussurveyfeet", kUsFootM},
    {"footus", kUsFootM},
    {"feetus", kUsFootM},
    {"surveyfoot", kUsFootM},
    {"surveyfeet", kUsFootM},
    {"fathom", 1.8288},
    {"fathoms", 1.8288},
    {"yard", 0.9144},
    {"yards", 0.9144},
}};

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
  for (const Unit& unit : kUnits) {
    if (unit.name == plain) return unit.metres;
  }
  return std::nullopt;
}

}  // namespace qmpipe
