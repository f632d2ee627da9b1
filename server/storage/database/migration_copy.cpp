// SQLite's online backup into a draft, which then gets its name.
#include "server/storage/database/migration_copy.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <stdexcept>
#include <string>

#include "server/storage/database/backup_copy.hpp"
#include "server/storage/database/disk_reserve.hpp"
#include "server/storage/database/finished_file.hpp"

namespace server::storage {
namespace fs = std::filesystem;

namespace {

constexpr double kMegabyte = 1e6;
constexpr std::int64_t kAuditSince = 5;  // version

// Distinguishes two states of one store: everything that is recorded increments one of these.
std::string state_of(SQLite::Database& database, std::int64_t version) {
  const auto text = [&](const char* sql) { return database.execAndGet(sql).getString(); };
  return text("SELECT coalesce(group_concat(name || '=' || value), '') FROM (SELECT * FROM meta ORDER BY name)") +
         text("SELECT ' ' || coalesce(max(event_row), 0) FROM event") +
         text("SELECT ' ' || count(*) || ' ' || coalesce(max(ended_at_us), 0) FROM command") +
         (version < kAuditSince ? "" : text("SELECT ' ' || coalesce(max(entry), 0) FROM audit"));
}

bool is_copy_of_state(const fs::path& copy, const std::string& state, std::int64_t version) {
  try {
    SQLite::Database database{copy.string(), SQLite::OPEN_READONLY};
    return database.execAndGet("PRAGMA user_version").getInt64() == version && state_of(database, version) == state;
  } catch (const SQLite::Exception&) {  // whatever it is, it stays
    return false;
  }
}

void check_room(SQLite::Database& database, const fs::path& path, std::int64_t version, FreeBytes free_bytes_in) {
  const auto pragma = [&](const char* sql) { return database.execAndGet(sql).getInt64(); };
  const auto bytes = static_cast<std::uint64_t>(pragma("PRAGMA page_count") * pragma("PRAGMA page_size"));
  const std::uint64_t needed = bytes + kDiskReserveBytes;  // the rest is for the migration itself
  const fs::path folder = fs::absolute(path).parent_path();
  const std::uint64_t free_bytes = free_bytes_in(folder);
  if (free_bytes >= needed) return;
  throw std::runtime_error{
      fmt::format("cannot bring {} from schema {} to the present one: a copy of it is kept first, which needs {:.1f} "
                  "MB, and {:.1f} "
                  "MB are free in {}. Make room there, or move the folder to a larger disk, and start again; until "
                  "then the program "
                  "that wrote it works with it as before, for nothing was changed",
                  path.string(), version, static_cast<double>(needed) / kMegabyte,
                  static_cast<double>(free_bytes) / kMegabyte, folder.string())};
}

void copy_to(SQLite::Database& database, const fs::path& target) {
  const Draft draft{fs::path{target}.concat(".part")};
  {
    BackupCopy copy{database, draft.path()};
    while (!copy.step(BackupCopy::kPagesAtOnce)) continue;
  }
  {
    SQLite::Database copy{draft.path().string(), SQLite::OPEN_READWRITE};
    copy.exec("PRAGMA journal_mode = DELETE");  // one file, that can be moved alone
  }
  finish_file(draft.path(), target);
}

}  // namespace

std::uint64_t available_bytes(const fs::path& folder) { return fs::space(folder).available; }

void keep_copy_before_migration(SQLite::Database& database, const fs::path& path, std::int64_t version,
                                FreeBytes free_bytes) {
  const std::string state = state_of(database, version);
  fs::path target = fs::path{path}.concat(fmt::format(".schema-{}", version));
  for (int number = 2; fs::exists(target); ++number) {
    if (is_copy_of_state(target, state, version)) return;  // an earlier start was cut off before it had migrated
    target = fs::path{path}.concat(fmt::format(".schema-{}.{}", version, number));
  }
  remove_draft(fs::path{target}.concat(".part"));  // of an earlier start that was cut off: its room is needed
  check_room(database, path, version, free_bytes);
  spdlog::info("{} has schema {}, which an earlier version wrote: it is copied before it is changed", path.string(),
               version);
  copy_to(database, target);
  spdlog::info("as it was it is kept in {}; remove that when you do not want to go back", target.string());
}

}  // namespace server::storage
