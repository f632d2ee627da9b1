// SQLite's online backup, step by step.
#include "server/storage/database/backup_copy.hpp"

#include <fmt/format.h>

#include <stdexcept>

#include "server/runtime/exceptions.hpp"
#include "server/storage/database/file_check.hpp"
#include "server/storage/database/finished_file.hpp"

namespace server::storage {
namespace {

SQLite::Database make_empty(const std::filesystem::path& path) {
  std::filesystem::remove(path);
  SQLite::Database database{path.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE};
  std::filesystem::permissions(path, std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  // Nobody reads it before it is complete, verified and synced.
  database.exec("PRAGMA journal_mode = OFF");
  database.exec("PRAGMA synchronous = OFF");
  return database;
}

}  // namespace

BackupCopy::BackupCopy(SQLite::Database& from, const std::filesystem::path& to)
    : to_{make_empty(to)}, backup_{sqlite3_backup_init(to_.getHandle(), "main", from.getHandle(), "main")} {
  if (backup_ == nullptr) throw SQLite::Exception{to_.getHandle(), to_.getErrorCode()};
}

bool BackupCopy::step(int pages) {
  const int result = sqlite3_backup_step(backup_.get(), pages);
  if (result == SQLITE_DONE) return true;
  if (result != SQLITE_OK && result != SQLITE_BUSY && result != SQLITE_LOCKED) {
    throw SQLite::Exception{sqlite3_errstr(result), result};
  }
  return false;
}

std::uint64_t BackupCopy::pages_total() const {
  return static_cast<std::uint64_t>(sqlite3_backup_pagecount(backup_.get()));
}

std::uint64_t BackupCopy::pages_done() const {
  return pages_total() - static_cast<std::uint64_t>(sqlite3_backup_remaining(backup_.get()));
}

namespace {

[[noreturn]] void fail_backup(const std::filesystem::path& from, const std::string& why) {
  throw std::runtime_error{fmt::format("no backup of '{}' was made: {}", from.string(), why)};
}

}  // namespace

void back_up_closed(const std::filesystem::path& from, const std::filesystem::path& to) {
  if (const auto problem = file_problem(from)) fail_backup(from, *problem);
  const Draft draft{std::filesystem::path{to}.concat(".part")};
  try {
    {
      SQLite::Database source{from.string(), SQLite::OPEN_READONLY};
      BackupCopy copy{source, draft.path()};
      while (!copy.step(BackupCopy::kPagesAtOnce)) continue;
    }
    SQLite::Database copy{draft.path().string(), SQLite::OPEN_READWRITE};
    copy.exec("PRAGMA journal_mode = DELETE");
    const std::string damage = find_damage(copy);
    if (!damage.empty()) fail_backup(from, "it is damaged: " + damage);
  } catch (const SQLite::Exception& error) {
    fail_backup(from, runtime::text_of(error));
  }
  finish_file(draft.path(), to);
}

}  // namespace server::storage
