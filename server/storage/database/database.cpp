// Opens the database, refuses what is not ours, and brings an older one up to date.
#include "server/storage/database/database.hpp"

#include <fmt/format.h>
#include <sodium.h>
#include <spdlog/spdlog.h>
#include <sqlite3.h>
#include <sys/stat.h>
#include <unistd.h>

#include <stdexcept>

#include "server/runtime/exceptions.hpp"
#include "server/runtime/private_file.hpp"
#include "server/storage/database/file_check.hpp"
#include "server/storage/database/migration_copy.hpp"
#include "server/storage/database/schema.hpp"
#include "server/storage/database/statement.hpp"

namespace server::storage {
namespace {

constexpr int kBusyTimeoutMs = 1000;  // of another program's lock; short, for all other jobs of the disk thread wait

[[noreturn]] void refuse(const std::filesystem::path& path, const std::string& why) {
  throw std::runtime_error{fmt::format(
      "cannot record into {}: {}. The file was left as it is; move it away, or choose another folder with --data",
      path.string(), why)};
}

std::int64_t pragma(SQLite::Database& database, const char* name) {
  return database.execAndGet(fmt::format("PRAGMA {}", name)).getInt64();
}

// A file of length 0, or one whose creation was cut off before its first transaction: nothing in it.
bool is_blank(SQLite::Database& database) {
  return pragma(database, "application_id") == 0 && pragma(database, "user_version") == 0 &&
         database.execAndGet("SELECT count(*) FROM sqlite_master").getInt64() == 0;
}

void set_up_blank(SQLite::Database& database) {
  database.exec("PRAGMA page_size = 4096");
  database.exec("PRAGMA auto_vacuum = INCREMENTAL");
}

// synchronous=FULL: what is committed survives a power cut, so a commit may be acknowledged to the robot.
void configure(SQLite::Database& database) {
  database.exec("PRAGMA journal_mode = WAL");
  database.exec("PRAGMA synchronous = FULL");
  database.exec("PRAGMA foreign_keys = ON");
  database.exec("PRAGMA wal_autocheckpoint = 0");  // Checkpointer
  database.exec("PRAGMA journal_size_limit = 67108864");
}

// While it is not known to be ours, its log is not written into it either when it is closed.
void keep_log(SQLite::Database& database, bool keep) {
  sqlite3_db_config(database.getHandle(), SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, keep ? 1 : 0, nullptr);
}

SQLite::Database open_checked(const std::filesystem::path& path) {
  if (const auto denial = runtime::denied(path, R_OK | W_OK)) refuse(path, *denial);
  if (is_symlink(path)) {  // SAFETY: it could lead to a file of somebody else
    throw std::runtime_error{
        fmt::format("'{}' is a link, and the database is not written through one: move the file that it leads to here, "
                    "with its -wal, or name the folder of that file with --data",
                    path.string())};
  }
  if (const auto problem = file_problem(path)) refuse(path, *problem);
  if (const auto kept = set_aside_orphaned_log(path)) {
    spdlog::error("{} is gone, and its write-ahead log is there: the log is kept as {}", path.string(), kept->string());
  }
  try {
    SQLite::Database database{path.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE | SQLite::OPEN_NOMUTEX,
                              kBusyTimeoutMs};
    keep_log(database, true);
    if (is_blank(database)) {
      keep_log(database, false);
      set_up_blank(database);
      configure(database);
      return database;
    }
    const std::int64_t application_id = pragma(database, "application_id");
    const std::int64_t version = pragma(database, "user_version");
    const auto known = static_cast<std::int64_t>(migrations().size());
    if (application_id != kApplicationId) {
      refuse(path, fmt::format("it belongs to another program (application_id {:#x}, Rheonaut's is {:#x})",
                               application_id, kApplicationId));
    }
    if (version < 1 || version > known) {
      refuse(path, fmt::format("its schema is version {}, this program knows 1 to {}; a newer Rheonaut made it",
                               version, known));
    }
    keep_log(database, false);
    configure(database);
    return database;
  } catch (const SQLite::Exception& error) {
    if (means_damage(error)) refuse(path, fmt::format("{}: {}", runtime::text_of(error), kDamageRemedy));
    refuse(path, runtime::text_of(error));
  }
}

// What a kill has left in the write-ahead log can be read, but the disk may not hold it yet, and robots will get
// it acknowledged as durable. And a log that goes on where a power cut has left it goes on inside a sector that holds a
// commit. So it begins anew, after a checkpoint, which first syncs it (so when there is no room for the rest, that is
// done).
void settle(SQLite::Database& database) {
  const int result =
      sqlite3_wal_checkpoint_v2(database.getHandle(), nullptr, SQLITE_CHECKPOINT_TRUNCATE, nullptr, nullptr);
  if (result == SQLITE_BUSY) {  // another program is reading the log: it stays, and a commit syncs it
    database.exec(fmt::format("PRAGMA user_version = {}", pragma(database, "user_version")));
  } else if (result != SQLITE_OK && result != SQLITE_FULL) {
    throw SQLite::Exception{database.getHandle(), result};
  }
}

// The file is checked again when what the log held is in it. No handle is open then: when a process closes any
// descriptor of a file, POSIX drops all locks that it has on the file. A handle that has lost its lock does not keep
// another program, when that closes the database, from removing the log into which the station goes on to commit.
SQLite::Database open_settled(const std::filesystem::path& path) {
  {
    SQLite::Database database = open_checked(path);
    settle(database);
  }
  return open_checked(path);
}

// All of them after this version, in one transaction.
void run_migrations(SQLite::Database& database, std::size_t version) {
  SQLite::Transaction transaction{database, SQLite::TransactionBehavior::IMMEDIATE};
  for (const char* script : migrations().subspan(version)) database.exec(script);
  if (version == 0) {
    std::uint64_t store_id = 0;
    randombytes_buf(&store_id, sizeof store_id);
    SQLite::Statement add{database, "INSERT INTO meta (name, value) VALUES (?, ?)"};
    execute(add, "store_id", store_id);
    execute(add, "next_row", std::int64_t{1});
  }
  database.exec(fmt::format("PRAGMA application_id = {}", kApplicationId));
  database.exec(fmt::format("PRAGMA user_version = {}", migrations().size()));
  transaction.commit();
}

[[noreturn]] void refuse_without_room(const std::filesystem::path& path, std::size_t version) {
  constexpr double kMegabyte = 1e6;
  const std::filesystem::path folder = std::filesystem::absolute(path).parent_path();
  throw std::runtime_error{fmt::format(
      "cannot bring {} from schema {} to the present one: the disk became full. The database has {:.1f} MB: make room "
      "for "
      "as much again in {}, or move the folder to a larger disk, and start again; until then the program that wrote it "
      "works with it as before, for nothing was changed",
      path.string(), version, static_cast<double>(std::filesystem::file_size(path)) / kMegabyte, folder.string())};
}

}  // namespace

Database::Database(const std::filesystem::path& path, BeforeMigration before) : handle_{open_settled(path)} {
  if (sodium_init() < 0) throw std::runtime_error{"libsodium cannot be initialised: the system gives no random bytes"};
  migrate(path, before);
  settle(handle_);  // the schema and the store's identity are in the file, whatever becomes of its log
  store_id_ = unsigned_id(handle_.execAndGet("SELECT value FROM meta WHERE name = 'store_id'"));
  restored_at_us_ = handle_.execAndGet("SELECT coalesce(max(value), 0) FROM meta WHERE name = 'restored_at_us'");
}

void Database::migrate(const std::filesystem::path& path, BeforeMigration before) {
  const auto version = static_cast<std::size_t>(pragma(handle_, "user_version"));
  if (version == migrations().size()) return;
  ::chmod(path.c_str(), S_IRUSR | S_IWUSR);  // it holds token hashes
  if (version > 0 && before == BeforeMigration::keep_copy) {
    keep_copy_before_migration(handle_, path, static_cast<std::int64_t>(version));
  }
  try {
    run_migrations(handle_, version);
  } catch (const SQLite::Exception& error) {
    if (error.getErrorCode() != SQLITE_FULL || version == 0) throw;
    refuse_without_room(path, version);
  }
}

void Database::checkpoint() { handle_.exec("PRAGMA wal_checkpoint(TRUNCATE)"); }

SQLite::Database open_for_reading(const std::filesystem::path& path) {
  SQLite::Database database{path.string(), SQLite::OPEN_READONLY | SQLite::OPEN_NOMUTEX, kBusyTimeoutMs};
  database.exec("PRAGMA query_only = ON");
  return database;
}

}  // namespace server::storage
