// A terminal of any number of rows, as far as progress needs one: lines that break at its width and are
// broken anew when that changes, and the control sequences that the program sends.
#pragma once

#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>
#include <vector>

#include "formats/bytes/printable.h"

namespace qmpipe::testing {

class TerminalModel {
 public:
  explicit TerminalModel(std::int64_t columns) : columns_(columns) {}

  void feed(std::string_view text) {
    while (!text.empty()) {
      std::size_t bytes = 1;
      if (text.starts_with("\033[")) {
        const std::size_t end = text.find_first_not_of("0123456789", 2);
        control(text[end], std::atoll(std::string(text.substr(2, end - 2)).c_str()));
        bytes = end + 1;
      } else if (text[0] == '\r') {
        column_ = 0;
      } else if (text[0] == '\n') {
        to_next_row(false);
      } else {
        while (bytes < text.size() && (static_cast<unsigned char>(text[bytes]) & 0xC0U) == 0x80) {
          ++bytes;
        }
        put(std::string(text.substr(0, bytes)));
      }
      text.remove_prefix(bytes);
    }
  }

  // As most terminals do it (VTE, kitty, Konsole, tmux): what was one line is broken anew, and the cursor
  // stays behind the character that it stood behind.
  void resize(std::int64_t columns) {
    std::vector<Row> old = std::move(rows_);
    rows_ = {Row()};
    const std::size_t cursor_row = row_;
    const std::int64_t cursor_column = column_;
    row_ = 0;
    column_ = 0;
    columns_ = columns;
    std::size_t new_row = 0;
    std::int64_t new_column = 0;
    for (std::size_t k = 0; k < old.size(); ++k) {
      std::int64_t at = 0;
      for (const std::string& cell : old[k].cells) {
        if (k == cursor_row && at == cursor_column) {
          new_row = row_;
          new_column = column_;
        }
        put(cell);
        ++at;
      }
      if (k == cursor_row && at <= cursor_column) {
        new_row = row_;
        new_column = column_;
      }
      if (old[k].goes_on || k + 1 == old.size()) continue;
      to_next_row(false);
      column_ = 0;
    }
    row_ = new_row;
    column_ = new_column;
  }

  // Without blanks at the end, and without empty rows there.
  std::vector<std::string> rows() const {
    std::vector<std::string> texts;
    for (const Row& row : rows_) {
      std::string text;
      for (const std::string& cell : row.cells) text += cell;
      text.erase(text.find_last_not_of(' ') + 1);
      texts.push_back(text);
    }
    while (!texts.empty() && texts.back().empty()) texts.pop_back();
    return texts;
  }

 private:
  // One cell a column; what is two columns wide is followed by an empty one.
  struct Row {
    std::vector<std::string> cells;
    bool goes_on = false;  // in the next one, because the window ended
  };

  void control(char what, std::int64_t number) {
    if (what == 'A')
      row_ -= std::min(row_, static_cast<std::size_t>(std::max<std::int64_t>(1, number)));
    if (what == 'J') rows_.resize(row_ + 1);
    if (what == 'J' || what == 'K') {
      Row& row = rows_[row_];
      row.cells.resize(std::min(row.cells.size(), static_cast<std::size_t>(column_)));
      row.goes_on = false;
    }
  }
  void to_next_row(bool goes_on) {
    rows_[row_].goes_on = goes_on;
    if (goes_on) column_ = 0;
    ++row_;
    if (row_ == rows_.size()) rows_.emplace_back();
  }
  void put(const std::string& character) {
    const std::int64_t wide = character.empty() ? 0 : columns_of(character);
    if (wide == 0) return;
    // The row is full: only the next character breaks it.
    if (column_ + wide > columns_) to_next_row(true);
    std::vector<std::string>& cells = rows_[row_].cells;
    const auto at = static_cast<std::size_t>(column_);
    if (cells.size() < at + static_cast<std::size_t>(wide)) {
      cells.resize(at + static_cast<std::size_t>(wide), " ");
    }
    cells[at] = character;
    if (wide == 2) cells[at + 1] = "";
    column_ += wide;
  }

  std::int64_t columns_;
  std::vector<Row> rows_{1};
  std::size_t row_ = 0;
  std::int64_t column_ = 0;
};

}  // namespace qmpipe::testing
