// An SQLite database that closes itself, with errors as values: a statement's text is ours, but the
// file it reads may be anybody's.
//
// Guarantees: no damaged or hostile file crashes the program; its views and triggers can call
// nothing that has effects, and with limit_work() not go on for ever. Error messages are SQLite's words, with the system's where it has any.
// One connection (with its statements) is used by one thread at a time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "formats/bytes/file_lock.h"
#include "formats/bytes/result.h"

struct sqlite3;
struct sqlite3_stmt;

namespace qmpipe {

// kReadFrozen takes no locks and writes nothing beside the file: for one that nobody changes.
enum class SqliteAccess { kRead, kReadFrozen, kWrite };

enum class SqliteType { kInteger, kReal, kText, kBlob, kNull };

// What a statement may still do, in SQLite's instructions.
struct SqliteBudget {
  std::int64_t whole = 0;
  std::int64_t left = 0;
};

// Must not outlive its SqliteFile.
class SqliteStatement {
 public:
  SqliteStatement(sqlite3_stmt* statement, SqliteBudget* budget)
      : statement_(statement), budget_(budget) {}

  // Parameters and columns count from 1 and from 0, as SQLite's do. What `bytes` or `text` point to
  // must live until the next reset().
  void bind(int parameter, std::int64_t value);
  void bind(int parameter, std::span<const std::uint8_t> bytes);
  void bind(int parameter, std::string_view text);
  // True when there is a row.
  Result<bool> step();
  // Ends the reading of rows, so that the statement can be bound and stepped again.
  void reset();

  SqliteType type(int column) const;
  std::int64_t integer(int column) const;
  // A blob's or a text's bytes, until the next step() or reset().
  std::span<const std::uint8_t> bytes(int column) const;
  // The same bytes as a text.
  std::string text(int column) const;

 private:
  struct Finalize {
    void operator()(sqlite3_stmt* statement) const;
  };
  std::unique_ptr<sqlite3_stmt, Finalize> statement_;
  SqliteBudget* budget_;
};

class SqliteFile {
 public:
  // kWrite makes the file when it is absent. No blob or text longer than `limit_bytes` is read. Where
  // the file system has no locks, kWrite takes a lock file (formats/bytes/file_lock.h), and throws its
  // IoError when another process has it.
  static Result<SqliteFile> open(const std::filesystem::path& path, SqliteAccess access,
                                 std::size_t limit_bytes);

  // From now on a statement that needs more instructions from a prepare() or reset() on ends with an
  // error; some ten thousand more may be done.
  void limit_work(std::int64_t instructions);
  // One or more statements whose rows are of no interest; what failed, or nothing.
  std::optional<Error> execute(const std::string& sql);
  Result<SqliteStatement> prepare(const std::string& sql);
  // Of the last call that failed: what to try ("Free some space ..."), may be empty.
  std::string remedy() const;
  // The last call failed because another connection has the file.
  bool is_busy() const;

 private:
  struct Close {
    void operator()(sqlite3* connection) const;
  };
  explicit SqliteFile(sqlite3* connection) : connection_(connection) {}

  std::unique_ptr<SqliteBudget> budget_ = std::make_unique<SqliteBudget>();
  std::unique_ptr<LockFile> lock_file_;  // outlives the connection
  std::unique_ptr<sqlite3, Close> connection_;
};

}  // namespace qmpipe
