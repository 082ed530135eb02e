#include "formats/mbtiles/sqlite_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sqlite3.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

#include "formats/bytes/file_bytes.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

// How long a reader waits for a writer that is about to finish.
constexpr int kPatienceMs = 2000;

// `code` may say more than the connection does, which is absent where there was no memory for it.
Error error_of(sqlite3* connection, int code) {
  if (connection == nullptr) return Error{sqlite3_errstr(code)};
  if ((code & 0xFF) == SQLITE_INTERRUPT) {
    return Error{"it makes SQLite work for longer than its size explains"};
  }
  const int system_error = sqlite3_system_errno(connection);
  if ((code & 0xFF) != SQLITE_CANTOPEN || system_error == 0) {
    return Error{sqlite3_errmsg(connection)};
  }
  return Error{fmt::format("{}: {}", sqlite3_errmsg(connection),
                           std::generic_category().message(system_error))};
}

enum class Locks { kSystem, kNone };

// As a URI, so that options can be said; every character that means something there is escaped.
std::string uri_of(const std::filesystem::path& path, SqliteAccess access, Locks locks) {
  std::string uri = "file:";
  for (const char c : std::filesystem::absolute(path).string()) {
    const auto byte = static_cast<unsigned char>(c);
    const bool is_plain = (byte >= '0' && byte <= '9') || (byte >= 'A' && byte <= 'Z') ||
                          (byte >= 'a' && byte <= 'z') || c == '/' || c == '.' || c == '-' ||
                          c == '_';
    uri += is_plain ? std::string(1, c) : fmt::format("%{:02X}", byte);
  }
  if (access == SqliteAccess::kReadFrozen) return uri + "?immutable=1";
  return locks == Locks::kNone ? uri + "?nolock=1" : uri;
}

// Whether the file system answers that it has no locks. SQLite calls that a disk error, or a busy file.
bool lacks_locks(const std::filesystem::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (descriptor < 0) return false;
  struct flock lock {};
  lock.l_type = F_RDLCK;
  lock.l_whence = SEEK_SET;
  const bool lacks = ::fcntl(descriptor, F_SETLK, &lock) != 0 && means_no_locks(errno);
  ::close(descriptor);
  return lacks;
}

// Asks for a lock as any use of the file does. A file that is none of SQLite's is refused later.
bool can_be_locked(sqlite3* connection, const std::filesystem::path& path) {
  const int code =
      sqlite3_exec(connection, "PRAGMA schema_version", nullptr, nullptr, nullptr) & 0xFF;
  const bool may_lack = code == SQLITE_IOERR || code == SQLITE_BUSY;
  // Closing a descriptor gives back the process's locks, of which there are none where this one failed.
  return !may_lack || !lacks_locks(path);
}

std::optional<Error> harden(sqlite3* connection, std::size_t limit_bytes) {
  sqlite3_extended_result_codes(connection, 1);
  sqlite3_limit(connection, SQLITE_LIMIT_LENGTH, static_cast<int>(limit_bytes));
  sqlite3_db_config(connection, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  sqlite3_db_config(connection, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  sqlite3_db_config(connection, SQLITE_DBCONFIG_ENABLE_TRIGGER, 0, nullptr);
  sqlite3_db_config(connection, SQLITE_DBCONFIG_DQS_DML, 0, nullptr);
  sqlite3_db_config(connection, SQLITE_DBCONFIG_DQS_DDL, 0, nullptr);
  // A mapped file that another process cuts short would end the program.
  const char* const pragmas =
      "PRAGMA mmap_size=0; PRAGMA cell_size_check=ON; PRAGMA temp_store=MEMORY;";
  const int code = sqlite3_exec(connection, pragmas, nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) return error_of(connection, code);
  return std::nullopt;
}

}  // namespace

void SqliteStatement::Finalize::operator()(sqlite3_stmt* statement) const {
  sqlite3_finalize(statement);
}

void SqliteStatement::bind(int parameter, std::int64_t value) {
  QMPIPE_CHECK(sqlite3_bind_int64(statement_.get(), parameter, value) == SQLITE_OK);
}

void SqliteStatement::bind(int parameter, std::span<const std::uint8_t> bytes) {
  // A null pointer would bind NULL.
  const int code = bytes.empty() ? sqlite3_bind_zeroblob(statement_.get(), parameter, 0)
                                 : sqlite3_bind_blob64(statement_.get(), parameter, bytes.data(),
                                                       bytes.size(), SQLITE_STATIC);
  QMPIPE_CHECK(code == SQLITE_OK);
}

void SqliteStatement::bind(int parameter, std::string_view text) {
  QMPIPE_CHECK(sqlite3_bind_text64(statement_.get(), parameter, text.empty() ? "" : text.data(),
                                   text.size(), SQLITE_STATIC, SQLITE_UTF8) == SQLITE_OK);
}

Result<bool> SqliteStatement::step() {
  const int code = sqlite3_step(statement_.get());
  if (code == SQLITE_ROW) return true;
  if (code == SQLITE_DONE) return false;
  return error_of(sqlite3_db_handle(statement_.get()), code);
}

void SqliteStatement::reset() {
  sqlite3_reset(statement_.get());
  budget_->left = budget_->whole;
}

SqliteType SqliteStatement::type(int column) const {
  switch (sqlite3_column_type(statement_.get(), column)) {
    case SQLITE_INTEGER:
      return SqliteType::kInteger;
    case SQLITE_FLOAT:
      return SqliteType::kReal;
    case SQLITE_TEXT:
      return SqliteType::kText;
    case SQLITE_BLOB:
      return SqliteType::kBlob;
    default:
      return SqliteType::kNull;
  }
}

std::int64_t SqliteStatement::integer(int column) const {
  return sqlite3_column_int64(statement_.get(), column);
}

std::span<const std::uint8_t> SqliteStatement::bytes(int column) const {
  // In this order: asking for the bytes may move the value, asking for their number does not.
  const void* const data = sqlite3_column_blob(statement_.get(), column);
  const int size = sqlite3_column_bytes(statement_.get(), column);
  if (data == nullptr || size <= 0) return {};
  return {static_cast<const std::uint8_t*>(data), static_cast<std::size_t>(size)};
}

std::string SqliteStatement::text(int column) const {
  const std::span<const std::uint8_t> value = bytes(column);
  return {reinterpret_cast<const char*>(value.data()), value.size()};
}

void SqliteFile::Close::operator()(sqlite3* connection) const {
  // Whatever transaction is open is rolled back.
  sqlite3_close(connection);
}

Result<SqliteFile> SqliteFile::open(const std::filesystem::path& path, SqliteAccess access,
                                    std::size_t limit_bytes) {
  const int flags = (access == SqliteAccess::kWrite ? SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE
                                                    : SQLITE_OPEN_READONLY) |
                    SQLITE_OPEN_URI | SQLITE_OPEN_NOMUTEX;
  std::unique_ptr<LockFile> lock_file;
  for (const Locks locks : {Locks::kSystem, Locks::kNone}) {
    sqlite3* connection = nullptr;
    const int code =
        sqlite3_open_v2(uri_of(path, access, locks).c_str(), &connection, flags, nullptr);
    // There is a connection to close even where it could not be opened.
    SqliteFile file(connection);
    if (code != SQLITE_OK) return error_of(connection, code);
    if (auto error = harden(connection, limit_bytes)) return *error;
    const bool is_last = locks == Locks::kNone || access == SqliteAccess::kReadFrozen;
    if (is_last || can_be_locked(connection, path)) {
      if (access != SqliteAccess::kWrite) sqlite3_busy_timeout(connection, kPatienceMs);
      file.lock_file_ = std::move(lock_file);
      return file;
    }
    // Nobody writes what is only read here: a file takes its name when it is whole.
    if (access == SqliteAccess::kWrite) lock_file = LockFile::make(path);
  }
  return Error{"it cannot be locked"};
}

std::optional<Error> SqliteFile::execute(const std::string& sql) {
  const int code = sqlite3_exec(connection_.get(), sql.c_str(), nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) return error_of(connection_.get(), code);
  return std::nullopt;
}

Result<SqliteStatement> SqliteFile::prepare(const std::string& sql) {
  sqlite3_stmt* statement = nullptr;
  const int code = sqlite3_prepare_v3(connection_.get(), sql.c_str(), -1, SQLITE_PREPARE_PERSISTENT,
                                      &statement, nullptr);
  if (code != SQLITE_OK) return error_of(connection_.get(), code);
  budget_->left = budget_->whole;
  return SqliteStatement(statement, budget_.get());
}

void SqliteFile::limit_work(std::int64_t instructions) {
  constexpr int kBetween = 10000;
  *budget_ = {.whole = instructions, .left = instructions};
  const auto is_over = [](void* budget) {
    std::int64_t& left = static_cast<SqliteBudget*>(budget)->left;
    left -= kBetween;
    return left < 0 ? 1 : 0;
  };
  sqlite3_progress_handler(connection_.get(), kBetween, is_over, budget_.get());
}

std::string SqliteFile::remedy() const {
  switch (sqlite3_errcode(connection_.get()) & 0xFF) {
    case SQLITE_FULL:
      return remedy_for_errno(ENOSPC);
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      return "Wait for that run, or stop it.";
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      return "The file is damaged: remove it, or pass --overwrite to start over.";
    case SQLITE_READONLY:
      return remedy_for_errno(EACCES);
    case SQLITE_IOERR:
      // SQLite forgets which it was.
      return "Check the disk, its quota and the limit on file sizes (ulimit -f), or choose another "
             "disk.";
    case SQLITE_CANTOPEN:
      return remedy_for_errno(sqlite3_system_errno(connection_.get()));
    default:
      return "";
  }
}

bool SqliteFile::is_busy() const {
  return (sqlite3_errcode(connection_.get()) & 0xFF) == SQLITE_BUSY;
}

}  // namespace qmpipe
