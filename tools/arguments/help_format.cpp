#include "tools/arguments/help_format.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "formats/bytes/printable.h"

namespace qmpipe {
namespace {

constexpr std::int64_t kColumns = 100;
constexpr std::int64_t kTextColumn = 28;
// Between what is to be typed and what it means.
constexpr std::int64_t kGap = 2;

constexpr std::array kGroups = {kRequiredGroup, kInputGroup,     kOutputGroup,  kQualityGroup,
                                kPapersGroup,   kResourcesGroup, kMessagesGroup};

// The part of a word that fits: a list may be broken behind a comma.
std::string_view fitting_part(std::string_view word, std::int64_t columns) {
  if (columns_of(word) <= columns) return word;
  const std::string fits = cut_to_columns(word, columns);
  const std::size_t comma = fits.rfind(',');
  return comma == std::string::npos ? word : word.substr(0, comma + 1);
}

// Appends words to `text`, whose last line is `column` wide, in lines indented by `indent`.
void append_wrapped(std::string& text, std::int64_t column, std::int64_t indent,
                    std::string_view words) {
  bool is_first = true;
  while (!words.empty()) {
    const std::size_t end = std::min(words.find(' '), words.size());
    const std::string_view part = fitting_part(words.substr(0, end), kColumns - indent);
    const std::int64_t blank = is_first ? 0 : 1;
    if (!is_first && column + blank + columns_of(part) > kColumns) {
      text += "\n" + std::string(static_cast<std::size_t>(indent), ' ');
      column = indent;
    } else if (!is_first) {
      text += ' ';
      ++column;
    }
    text += part;
    column += columns_of(part);
    words.remove_prefix(part.size());
    // A word goes on in the next line without a blank.
    is_first = false;
    if (!words.empty() && words.front() == ' ') words.remove_prefix(1);
  }
}

// A text of several lines, each of them indented as it is.
std::string wrapped_lines(std::string_view text) {
  std::string wrapped;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = text.substr(0, end);
    const std::size_t indent = std::min(line.find_first_not_of(' '), line.size());
    wrapped += line.substr(0, indent);
    const auto column = static_cast<std::int64_t>(indent);
    append_wrapped(wrapped, column, column, line.substr(indent));
    wrapped += '\n';
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return wrapped;
}

// "  what      text", where `what` may be too long for its column.
std::string entry(const std::string& what, const std::string& text) {
  std::string line = "  " + what;
  std::int64_t column = columns_of(line);
  if (column + kGap > kTextColumn) {
    line += '\n';
    column = 0;
  }
  line += std::string(static_cast<std::size_t>(kTextColumn - column), ' ');
  append_wrapped(line, kTextColumn, kTextColumn, text);
  return line + "\n";
}

// CLI11 adds what its checks demand: "INT:INT in [1 - 10]", "TEXT:{a,b}".
std::string type_of(const CLI::Option& option) {
  const std::string whole = option.get_type_name();
  const std::string type = whole.substr(0, whole.find(':'));
  if (type == "INT" || type == "UINT") return "N";
  return type == "FLOAT" ? "X" : type;
}

std::string range_of(const CLI::Option& option) {
  const std::string whole = option.get_type_name();
  const std::size_t open = whole.find(" in [");
  const std::size_t dash = whole.find(" - ", open);
  const std::size_t close = whole.find(']', open);
  if (open == std::string::npos || dash == std::string::npos || close < dash) return "";
  return whole.substr(open + 5, dash - open - 5) + " to " +
         whole.substr(dash + 3, close - dash - 3);
}

// Behind one name, and not by naming it again.
bool takes_many(const CLI::Option& option) {
  return option.get_expected_max() >= CLI::detail::expected_max_vector_size &&
         (option.get_positional() || option.get_allow_extra_args());
}

std::string what_to_type(const CLI::Option& option) {
  if (option.get_positional())
    return option.get_name(true, false) + (takes_many(option) ? "..." : "");
  std::string names = option.get_name(false, true);
  if (const std::size_t comma = names.find(','); comma != std::string::npos)
    names.insert(comma + 1, " ");
  if (option.get_type_size() == 0) return names;
  return names + " " + type_of(option) + (takes_many(option) ? " ..." : "");
}

std::string name_of(const CLI::Option& option) { return option.get_name(false, false); }

// "-o" of "-o,--output".
std::string short_name_of(const CLI::Option& option) {
  const std::string names = option.get_name(false, true);
  return names.substr(0, names.find(','));
}

std::string text_of(const CLI::Option& option) {
  std::vector<std::string> facts;
  std::string value = option.get_default_str();
  if (value.starts_with('[') && value.ends_with(']')) value = value.substr(1, value.size() - 2);
  if (!value.empty()) facts.push_back("default: " + value);
  if (const std::string range = range_of(option); !range.empty()) facts.push_back(range);
  for (const CLI::Option* other : option.get_needs()) facts.push_back("needs " + name_of(*other));
  for (const CLI::Option* other : option.get_excludes()) {
    facts.push_back("not with " + name_of(*other));
  }
  if (facts.empty()) return option.get_description();
  return option.get_description() + " (" + CLI::detail::join(facts, "; ") + ")";
}

bool is_about_program(const CLI::App& app, const CLI::Option& option) {
  return &option == app.get_help_ptr() || &option == app.get_version_ptr();
}

std::string group_of(const CLI::App& app, const CLI::Option& option) {
  if (is_about_program(app, option)) return kMessagesGroup;
  return option.get_required() ? kRequiredGroup : option.get_group();
}

// Those of a group, what has no name of its own last.
std::vector<const CLI::Option*> options_of(const CLI::App& app, const std::string& group) {
  std::vector<const CLI::Option*> options =
      app.get_options([&](const CLI::Option* option) { return group_of(app, *option) == group; });
  std::stable_partition(options.begin(), options.end(),
                        [](const CLI::Option* option) { return !option->get_positional(); });
  return options;
}

class HelpFormat final : public CLI::Formatter {
 public:
  std::string make_help(const CLI::App* app, std::string name, CLI::AppFormatMode) const override {
    std::string text = wrapped_lines(app->get_description() + "\n\n" + usage(*app, name));
    std::vector<std::string> groups(kGroups.begin(), kGroups.end());
    // What belongs to none of them is shown all the same.
    for (const std::string& group : app->get_groups()) {
      if (std::find(groups.begin(), groups.end(), group) == groups.end()) groups.push_back(group);
    }
    for (const std::string& group : groups) {
      const std::vector<const CLI::Option*> options = options_of(*app, group);
      if (group.empty() || options.empty()) continue;
      if (group == kMessagesGroup) text += commands(*app);
      text += "\n" + group + ":\n";
      for (const CLI::Option* option : options)
        text += entry(what_to_type(*option), text_of(*option));
    }
    return text + "\n" + wrapped_lines(app->get_footer());
  }

 private:
  static std::string usage(const CLI::App& app, const std::string& name) {
    std::string text = "Usage: " + name;
    for (const CLI::Option* option : options_of(app, kRequiredGroup)) {
      const bool is_named = !option->get_positional();
      text += " " +
              (is_named ? short_name_of(*option) + " " + type_of(*option) : what_to_type(*option));
    }
    return text + (app.get_subcommands({}).empty() ? " [options]" : " COMMAND [options]");
  }

  static std::string commands(const CLI::App& app) {
    std::string text;
    for (const CLI::App* command : app.get_subcommands({})) {
      if (text.empty()) text = "\nCommands:\n";
      text += entry(command->get_name(), command->get_description());
    }
    return text;
  }
};

}  // namespace

void begin_group(CLI::App& command, const char* group) { command.option_defaults()->group(group); }

void set_help_format(CLI::App& app) { app.formatter(std::make_shared<HelpFormat>()); }

}  // namespace qmpipe
