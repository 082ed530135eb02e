#include "tools/arguments/number_options.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <string_view>

namespace qmpipe {
namespace {

std::optional<double> number_of(std::string_view text) {
  // What a person may write and from_chars() does not take.
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (code != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

bool takes_a_number(const CLI::Option& option) {
  static constexpr std::array<std::string_view, 5> kNames = {"INT", "UINT", "FLOAT", "SECONDS",
                                                             "X,Y,Z"};
  // The names of its checks follow.
  const std::string whole = option.get_type_name();
  const std::string_view name = std::string_view(whole).substr(0, whole.find_first_of(": "));
  if (name.size() == 1 && name[0] >= 'A' && name[0] <= 'Z') return true;
  return std::find(kNames.begin(), kNames.end(), name) != kNames.end();
}

// Leading zeros are dropped, which C would take for a sign of octal numbers.
std::string make_decimal(std::string& text) {
  if (!number_of(text)) {
    return text + " is no decimal number; write it as in 16, 0.5 or 1e-3";
  }
  const std::size_t first = text.find_first_of("0123456789");
  if (first == std::string::npos) return "";
  const std::size_t kept = text.find_first_not_of('0', first);
  const bool is_digit = kept != std::string::npos && text[kept] >= '0' && text[kept] <= '9';
  if (kept != first && is_digit) text.erase(first, kept - first);
  return "";
}

}  // namespace

std::string fault_of_negative(const std::string& text) {
  const auto number = number_of(text);
  return number && !(*number >= 0) ? text + " is not 0 or more" : "";
}

std::string fault_of_not_positive(const std::string& text) {
  const auto number = number_of(text);
  return number && !(*number > 0) ? text + " is not more than 0" : "";
}

void read_decimal_numbers_only(CLI::App& app) {
  for (CLI::Option* option : app.get_options()) {
    // A flag has no value of its own.
    if (option->get_expected_max() > 0 && takes_a_number(*option)) {
      // Before the checks, which would read the text as C does.
      option->transform(CLI::Validator(make_decimal, ""));
    }
  }
  for (CLI::App* command : app.get_subcommands({})) read_decimal_numbers_only(*command);
}

}  // namespace qmpipe
