// The one writing handle of the station's database: opened, checked and migrated here.
//
// Used on the disk thread only (and by its owner before that thread works and after it has ended). A file that is not
// ours is refused with an exception that says what it is and what to do, and is left as it was.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <filesystem>

namespace server::storage {

enum class BeforeMigration : std::uint8_t { keep_copy, change_in_place };

class Database {
 public:
  // Creates the file if there is none. One of an older schema is copied before it is changed (migration_copy.hpp),
  // unless it is a copy itself.
  explicit Database(const std::filesystem::path& path, BeforeMigration before = BeforeMigration::keep_copy);

  SQLite::Database& handle() { return handle_; }

  // Random, made with the file: a robot sees by it that it talks to another store.
  std::uint64_t store_id() const { return store_id_; }

  // UTC when it was made of a backup; 0: it was not.
  std::int64_t restored_at_us() const { return restored_at_us_; }

  // Moves the write-ahead log into the file and empties it.
  void checkpoint();

 private:
  void migrate(const std::filesystem::path& path, BeforeMigration before);

  SQLite::Database handle_;
  std::uint64_t store_id_ = 0;
  std::int64_t restored_at_us_ = 0;
};

// For queries, beside the writing handle; never blocks it. For one thread at a time: SQLite takes no lock for it.
SQLite::Database open_for_reading(const std::filesystem::path& path);

}  // namespace server::storage
