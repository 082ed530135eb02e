// How --help looks in every command: at most 100 columns, options in groups, what must be given first,
// and of each option its unit (in its text), default and range.
//
// An option belongs to the group that was begun last in its command, so that a function that adds
// options begins one and the rest follows.
#pragma once

namespace CLI {
class App;
}

namespace qmpipe {

// In the order in which they are shown.
inline constexpr const char* kRequiredGroup = "Required";
inline constexpr const char* kInputGroup = "Input";
inline constexpr const char* kOutputGroup = "Output";
inline constexpr const char* kQualityGroup = "Quality";
inline constexpr const char* kPapersGroup = "The papers' parameters";
inline constexpr const char* kResourcesGroup = "Resources";
inline constexpr const char* kMessagesGroup = "Messages";

// Options added from here on belong to it; those that CLI11 knows as required to kRequiredGroup.
void begin_group(CLI::App& command, const char* group);

// To be called before any command is added.
void set_help_format(CLI::App& app);

}  // namespace qmpipe
