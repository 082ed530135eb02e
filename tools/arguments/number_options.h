// Numbers on the command line, alike in every command: decimal, and refused in words a person reads.
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace qmpipe {

// For the checks of an option, in place of CLI11's NonNegativeNumber and PositiveNumber, whose refusals
// print the largest double with all its digits. Empty, or what is wrong; what is no number at all is
// left to the conversion.
std::string fault_of_negative(const std::string& text);
std::string fault_of_not_positive(const std::string& text);

// Makes each option of the app and its commands that takes a number read decimal ones alone: C's ways
// of writing them would take 0x10 for 16 and 010 for 8. An option takes a number when its type name is
// INT, UINT, FLOAT, SECONDS, X,Y,Z or one capital letter. To be called once all options are there.
void read_decimal_numbers_only(CLI::App& app);

}  // namespace qmpipe
