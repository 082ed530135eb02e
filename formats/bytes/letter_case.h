// Names compared as HTTP, CF and file endings compare them, whatever the locale.
#pragma once

#include <string>
#include <string_view>

namespace qmpipe {

// "Gzip" as "gzip". ASCII only: all other bytes stay.
std::string lower_case(std::string_view text);

}  // namespace qmpipe
