// Copy, verify, mark, rename.
#include "server/storage/upkeep/restore.hpp"

#include <fmt/format.h>
#include <sodium.h>
#include <unistd.h>

#include <nlohmann/json.hpp>
#include <stdexcept>

#include "server/runtime/exceptions.hpp"
#include "server/runtime/private_file.hpp"
#include "server/storage/audit/audit_chain.hpp"
#include "server/storage/database/backup_copy.hpp"
#include "server/storage/database/database.hpp"
#include "server/storage/database/file_check.hpp"
#include "server/storage/database/finished_file.hpp"
#include "server/storage/database/foreign_file.hpp"
#include "server/storage/database/schema.hpp"
#include "server/storage/database/statement.hpp"
#include "server/storage/runs/run_store.hpp"
#include "server/storage/upkeep/store_head.hpp"

namespace server::storage {
namespace fs = std::filesystem;

namespace {

[[noreturn]] void refuse(const fs::path& from, const std::string& why) {
  throw std::runtime_error{fmt::format("cannot restore from '{}': {}; nothing was restored", from.string(), why)};
}

void check(const fs::path& from, const fs::path& to) {
  if (const auto denial = runtime::denied(from, R_OK)) refuse(from, *denial);
  if (!fs::is_regular_file(from)) refuse(from, "there is no such file");
  for (const char* suffix : {"", "-wal", "-journal"}) {
    const fs::path existing = fs::path{to}.concat(suffix);
    if (!fs::exists(existing)) continue;
    refuse(from, fmt::format("'{}' is there; move it away, or choose another folder with --data", existing.string()));
  }
  if (fs::file_size(from) == 0) refuse(from, "it is empty");
  if (const auto problem = file_problem(from)) refuse(from, *problem);
}

void copy_database(const fs::path& from, const fs::path& to) {
  SQLite::Database source{from.string(), SQLite::OPEN_READONLY};
  guard_foreign(source);
  BackupCopy copy{source, to};
  while (!copy.step(BackupCopy::kPagesAtOnce)) continue;
}

RestoredStore mark(Database& database, const fs::path& from, const station::Author& by) {
  RestoredStore restored;
  restored.runs_interrupted = static_cast<std::int64_t>(RunStore{database}.interrupt(by.at_us).size());
  SQLite::Database& handle = database.handle();
  SQLite::Transaction transaction{handle, SQLite::TransactionBehavior::IMMEDIATE};
  randombytes_buf(&restored.store_id, sizeof restored.store_id);
  SQLite::Statement set{handle, "INSERT OR REPLACE INTO meta (name, value) VALUES (?, ?)"};
  execute(set, "store_id", restored.store_id);
  execute(set, "restored_at_us", by.at_us);
  handle.exec("DELETE FROM page_session");     // of the time of the backup: users signed out since stay so
  handle.exec("UPDATE robot SET fluid = ''");  // SAFETY: robots may have been put into others since
  station::AuditNote note;
  note.by = by;
  note.action = "store.restored";
  note.detail =
      station::audit_detail({{"from", from.filename().string()}, {"store_id", std::to_string(restored.store_id)}});
  AuditChain{handle}.append(note);
  transaction.commit();
  restored.runs = handle.execAndGet("SELECT count(*) FROM run").getInt64();
  restored.samples = handle.execAndGet("SELECT coalesce(sum(last_seq - first_seq + 1), 0) FROM segment").getInt64();
  return restored;
}

}  // namespace

fs::path restore_draft(const fs::path& folder) { return folder / "station.sqlite.part"; }

RestoredStore restore_database(const fs::path& from, const fs::path& folder, const station::Author& by) {
  const fs::path to = folder / "station.sqlite";
  check(from, to);
  const Draft draft{restore_draft(folder)};
  RestoredStore restored;
  HeadFile head;
  try {
    copy_database(from, draft.path());
    SQLite::Database written{draft.path().string(), SQLite::OPEN_READWRITE};
    guard_foreign(written);
    if (written.execAndGet("PRAGMA application_id").getInt64() != kApplicationId) refuse(from, "it is not a backup");
    if (const auto strange = strange_in_schema(written)) {
      refuse(from, fmt::format("no version of this program wrote its {}", *strange));
    }
    const std::string damage = find_damage(written);
    if (!damage.empty()) refuse(from, "it is damaged: " + damage);
  } catch (const SQLite::Exception& error) {
    refuse(from, runtime::text_of(error));
  }
  {
    Database database{draft.path(), BeforeMigration::change_in_place};  // the backup is the copy
    restored = mark(database, from, by);
    database.checkpoint();
    head = {read_store_head(database.handle()), by.at_us, {}};
  }
  save_head_file(to, head);  // in place of that of a database that was moved away
  finish_file(draft.path(), to);
  return restored;
}

}  // namespace server::storage
