// Text from files, servers and command lines on its way to a terminal or a log: names, attributions,
// units and paths must not steer the one or forge a line of the other.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace qmpipe {

// A stream's text in pieces. Control characters (C0, DEL, C1), line separators and marks that turn the
// direction of writing become \u001b and the like, which is right inside JSON too; bytes that are
// no UTF-8 become \x9b. New lines and tabs stay.
class PrintableFilter {
 public:
  // A character that the piece cuts in two comes with the next one.
  std::string pass(std::string_view piece);
  // What is left of such a character at the end.
  std::string finish();

 private:
  std::string begun_;
};

// A whole text.
std::string printable(std::string_view text);

// The same for a value that belongs in one line: new lines and tabs become \n and \t.
std::string printable_line(std::string_view text);

// The same for a message of several lines: those after the first are indented, so that none of them can
// pass for a message of its own.
std::string printable_message(std::string_view text);

// How many columns of a terminal a printable line takes: two for what East Asian writing and emoji make
// twice as wide. It may be fewer where a terminal puts marks on top of each other, but never more.
std::int64_t columns_of(std::string_view line);

// As much of the line as fits, whole characters only. REQUIRES: columns >= 0.
std::string cut_to_columns(std::string_view line, std::int64_t columns);

}  // namespace qmpipe
