#include "formats/mbtiles/schema.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <utility>

namespace qmpipe {
namespace {

struct Token {
  enum class Kind { kName, kQuotedName, kSign, kEnd };
  Kind kind = Kind::kEnd;
  std::string text;  // names as they are, bare ones in lower case
};

bool is_name_byte(char c) {
  const auto byte = static_cast<unsigned char>(c);
  return std::isalnum(byte) != 0 || c == '_' || byte >= 0x80;
}

// The text of a quoted name, whose quotes are doubled inside; moves `at` behind it. None when the
// quote does not end.
std::optional<std::string> quoted_name(const std::string& sql, std::size_t& at) {
  const char end = sql[at] == '[' ? ']' : sql[at];
  std::string name;
  for (++at; at < sql.size(); ++at) {
    if (sql[at] != end) {
      name += sql[at];
    } else if (end != ']' && at + 1 < sql.size() && sql[at + 1] == end) {
      name += sql[at++];
    } else {
      ++at;
      return name;
    }
  }
  return std::nullopt;
}

// None for what no view of ours has: numbers, texts, comments, other operators.
std::optional<std::vector<Token>> tokens_of(const std::string& sql) {
  std::vector<Token> tokens;
  for (std::size_t at = 0; at < sql.size();) {
    const char c = sql[at];
    if (std::isspace(static_cast<unsigned char>(c)) != 0) {
      ++at;
    } else if (c == '"' || c == '`' || c == '[') {
      auto name = quoted_name(sql, at);
      if (!name) return std::nullopt;
      tokens.push_back({.kind = Token::Kind::kQuotedName, .text = std::move(*name)});
    } else if (is_name_byte(c) && std::isdigit(static_cast<unsigned char>(c)) == 0) {
      Token token = {.kind = Token::Kind::kName, .text = {}};
      for (; at < sql.size() && is_name_byte(sql[at]); ++at) {
        token.text += static_cast<char>(std::tolower(static_cast<unsigned char>(sql[at])));
      }
      tokens.push_back(std::move(token));
    } else if (std::string(",.=();*").find(c) != std::string::npos) {
      tokens.push_back({.kind = Token::Kind::kSign, .text = std::string(1, c)});
      ++at;
    } else {
      return std::nullopt;
    }
  }
  tokens.emplace_back();
  return tokens;
}

// Takes a view apart. Each method takes its part of the tokens, or returns false.
class ViewParser {
 public:
  explicit ViewParser(std::vector<Token> tokens) : tokens_(std::move(tokens)) {}

  bool parse() {
    return word("create") && word("view") && name() && name_list_or_nothing() && word("as") &&
           word("select") && columns() && word("from") && sources() && end();
  }
  std::vector<std::string> tables() && { return std::move(tables_); }

 private:
  bool is_sign(const char* text) const {
    return tokens_[at_].kind == Token::Kind::kSign && tokens_[at_].text == text;
  }
  bool is_word(const char* text) const {
    return tokens_[at_].kind == Token::Kind::kName && tokens_[at_].text == text;
  }
  bool sign(const char* text) {
    if (!is_sign(text)) return false;
    ++at_;
    return true;
  }
  bool word(const char* text) {
    if (!is_word(text)) return false;
    ++at_;
    return true;
  }
  bool is_name() const {
    static constexpr std::array<const char*, 12> kWords = {"as",    "select", "from",  "join",
                                                           "inner", "left",   "outer", "on",
                                                           "using", "where",  "and",   "distinct"};
    const Token& token = tokens_[at_];
    if (token.kind == Token::Kind::kQuotedName) return true;
    return token.kind == Token::Kind::kName &&
           std::none_of(kWords.begin(), kWords.end(),
                        [&token](const char* known) { return token.text == known; });
  }
  bool name() {
    if (!is_name()) return false;
    ++at_;
    return true;
  }
  bool name_list_or_nothing() { return !is_sign("(") || name_list(); }
  bool name_list() {
    if (!sign("(")) return false;
    do {
      if (!name()) return false;
    } while (sign(","));
    return sign(")");
  }
  // a or a.b
  bool column() { return name() && (!sign(".") || name()); }
  bool columns() {
    do {
      if (sign("*")) continue;
      if (!column()) return false;
      if (word("as")) {
        if (!name()) return false;
      } else if (is_name()) {
        ++at_;
      }
    } while (sign(","));
    return true;
  }
  bool table() {
    if (!is_name()) return false;
    tables_.push_back(tokens_[at_++].text);
    if (word("as")) return name();
    if (is_name()) ++at_;
    return true;
  }
  bool equation() {
    if (sign("(")) return depth_++ < kMostDepth && equations() && sign(")");
    if (!column() || !sign("=")) return false;
    sign("=");
    return column();
  }
  bool equations() {
    do {
      if (!equation()) return false;
    } while (word("and"));
    return true;
  }
  bool sources() {
    if (!table()) return false;
    const bool is_list = sign(",");
    if (!is_list) {
      if (word("left")) {
        word("outer");
        if (!is_word("join")) return false;
      } else if (word("inner") && !is_word("join")) {
        return false;
      }
    }
    if (is_list || word("join")) {
      if (!table()) return false;
      if (word("using")) {
        if (!name_list()) return false;
      } else if (word("on") && !equations()) {
        return false;
      }
    }
    return !word("where") || equations();
  }
  bool end() {
    sign(";");
    return tokens_[at_].kind == Token::Kind::kEnd;
  }

  static constexpr int kMostDepth = 20;
  std::vector<Token> tokens_;
  std::size_t at_ = 0;
  int depth_ = 0;
  std::vector<std::string> tables_;
};

struct SchemaObject {
  std::string type;
  std::string sql;
  bool is_stored = false;  // has pages of its own, as no view and no virtual table has
};

Result<std::optional<SchemaObject>> find_object(SqliteFile& file, const std::string& name) {
  auto row = file.prepare(
      "SELECT type, sql, rootpage FROM sqlite_schema WHERE type IN ('table', 'view') AND "
      "name=?1 COLLATE NOCASE");
  if (!row) return row.error();
  row->bind(1, std::string_view(name));
  const auto has_row = row->step();
  if (!has_row) return has_row.error();
  if (!*has_row) return std::optional<SchemaObject>();
  return std::optional(
      SchemaObject{.type = row->text(0), .sql = row->text(1), .is_stored = row->integer(2) > 0});
}

// Columns that are computed run what the file says.
Result<bool> has_computed_columns(SqliteFile& file, const std::string& name) {
  auto row = file.prepare("SELECT 1 FROM pragma_table_xinfo(?1) WHERE hidden<>0");
  if (!row) return row.error();
  row->bind(1, std::string_view(name));
  return row->step();
}

std::optional<Error> fault_of_table(SqliteFile& file, const std::string& name,
                                    const SchemaObject& table) {
  if (!table.is_stored || !table.sql.starts_with("CREATE TABLE")) {
    return Error{fmt::format("its `{}` is no ordinary table", name)};
  }
  const auto computes = has_computed_columns(file, name);
  if (!computes) return computes.error();
  if (*computes) return Error{fmt::format("its table `{}` has computed columns", name)};
  return std::nullopt;
}

std::optional<Error> fault_of_view(SqliteFile& file, const std::string& name,
                                   const SchemaObject& view) {
  const auto tables = tables_of_view(view.sql);
  if (!tables) {
    return Error{fmt::format("its view `{}` {}; copy what it shows into a table of that name", name,
                             tables.error().message)};
  }
  for (const std::string& table : *tables) {
    const auto object = find_object(file, table);
    if (!object) return object.error();
    if (!*object || (*object)->type != "table") {
      return Error{
          fmt::format("its view `{}` reads `{}`, which is no table of the file", name, table)};
    }
    if (auto error = fault_of_table(file, table, **object)) return error;
  }
  return std::nullopt;
}

}  // namespace

Result<std::vector<std::string>> tables_of_view(const std::string& sql) {
  const Error foreign = {"does more than pick columns of one table or of two that are joined"};
  auto tokens = tokens_of(sql);
  if (!tokens) return foreign;
  ViewParser parser(std::move(*tokens));
  if (!parser.parse()) return foreign;
  return std::move(parser).tables();
}

std::optional<Error> fault_of_schema(SqliteFile& file) {
  for (const std::string name : {"tiles", "metadata"}) {
    const auto object = find_object(file, name);
    if (!object) return object.error();
    if (!*object) continue;
    auto error = (*object)->type == "view" ? fault_of_view(file, name, **object)
                                           : fault_of_table(file, name, **object);
    if (error) return error;
  }
  return std::nullopt;
}

}  // namespace qmpipe
