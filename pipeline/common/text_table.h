// Numbers and tables in reports for people.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace qmpipe {

// 1234567 as "1,234,567".
std::string grouped(std::int64_t number);

// "1 tile", "12,000 tiles".
std::string counted(std::int64_t number, const char* noun);

using TableRow = std::vector<std::string>;

// A line for each row, columns aligned to the right, two blanks apart. REQUIRES: at least one row,
// and none longer than the first.
std::string table_text(const std::vector<TableRow>& rows);

}  // namespace qmpipe
