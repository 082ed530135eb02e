#include "pipeline/common/text_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>

namespace qmpipe {

std::string grouped(std::int64_t number) {
  std::string digits = std::to_string(number);
  for (auto at = static_cast<std::ptrdiff_t>(digits.size()) - 3; at > 0; at -= 3) {
    digits.insert(static_cast<std::size_t>(at), 1, ',');
  }
  return digits;
}

std::string counted(std::int64_t number, const char* noun) {
  return grouped(number) + " " + noun + (number == 1 ? "" : "s");
}

std::string table_text(const std::vector<TableRow>& rows) {
  std::vector<std::size_t> widths(rows.front().size(), 0);
  for (const TableRow& row : rows) {
    for (std::size_t k = 0; k < row.size(); ++k) widths[k] = std::max(widths[k], row[k].size());
  }
  std::string text;
  for (const TableRow& row : rows) {
    for (std::size_t k = 0; k < row.size(); ++k) {
      text += fmt::format("{}{:>{}}", k == 0 ? "" : "  ", row[k], widths[k]);
    }
    text += "\n";
  }
  return text;
}

}  // namespace qmpipe
