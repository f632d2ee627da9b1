// A copy of a live database, page by page, in short steps.
//
// It reads through the handle that writes: what that handle commits between two steps is carried into the copy, so the
// copy never begins again, and no read transaction outlives a step and holds the write-ahead log. The copy is what the
// database is when the last step ends. It is not synced yet.
//
// Used on the thread of the handle it copies from, which outlives it. Throws SQLite::Exception; a copy that cannot be
// written does not harm the database.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>
#include <sqlite3.h>

#include <cstdint>
#include <filesystem>
#include <memory>

namespace server::storage {

class BackupCopy {
 public:
  static constexpr int kPagesAtOnce = 4096;  // where nobody waits for the database meanwhile

  // Replaces the file `to`.
  BackupCopy(SQLite::Database& from, const std::filesystem::path& to);

  // Copies at most this number of pages. True: the copy is complete.
  bool step(int pages);

  // Lets go of the handle it copies from, after the last step. What is left to do concerns the copy's file alone, and
  // is done where this object is destroyed, on any thread.
  void finish() { backup_.reset(); }

  std::uint64_t pages_done() const;
  std::uint64_t pages_total() const;

 private:
  struct Finish {
    void operator()(sqlite3_backup* backup) const { sqlite3_backup_finish(backup); }
  };

  SQLite::Database to_;
  std::unique_ptr<sqlite3_backup, Finish> backup_;
};

// A verified backup of a database in whose folder no station runs; `to` becomes visible when it is whole. Throws
// std::runtime_error that says why there is none.
void back_up_closed(const std::filesystem::path& from, const std::filesystem::path& to);

}  // namespace server::storage
