// Second names for the open files of the database, and whether their own names still lead to them.
//
//   <folder>/station.kept/station.sqlite, -wal, -shm      hard links
//
// Who removes, renames or replaces a file of a running station takes its name and not what is in it; without any name
// it is lost when the station ends. So the names are compared after each commit, before anything of it is acknowledged.
// Nobody opens the second names while the station works. An orderly end removes them; the next start after a kill
// removes them where the names are right, and else sets the folder aside and names it, until a person removes it.
//
// SQLite may only be given a name of the database while all three lead to the open files (hold()): with a log and an
// index of another file it damages both. Disk thread, but hold(), which any thread may ask.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace server::storage {

// Where a copy goes when there are no second names, as on a disk without hard links, or in a folder that is gone.
struct RescuePlace {
  std::filesystem::path folder;   // for backups
  std::uint64_t spare_bytes = 0;  // that stay free
};

class KeptFiles {
 public:
  // The database is open, and its log.
  KeptFiles(const std::filesystem::path& database, RescuePlace rescue);

  // All three names lead to the files that are open.
  bool hold() const { return has_name(0) && has_name(1) && has_name(2); }

  // Empty: what the handle holds has its names; a log or an index that has lost its name has it again. Otherwise what
  // is wrong and what to do; what the handle holds is found under other names then. Does not throw.
  std::string problem(SQLite::Database& handle);

  // Before the last handle is closed in order: SQLite then removes the log, and a second name of it would only harm.
  void remove();

 private:
  struct Identity {
    std::uint64_t device = 0, number = 0;
    bool operator==(const Identity&) const = default;
  };
  static std::optional<Identity> identity_of(const std::filesystem::path& path);  // none: it is not there

  bool has_name(std::size_t file) const;
  void link();
  void put_back_log(SQLite::Database& handle);
  void secure(SQLite::Database& handle);
  void copy(SQLite::Database& handle);

  const std::filesystem::path database_;
  const RescuePlace rescue_;
  std::array<Identity, 3> open_;   // of database, -wal, -shm
  std::filesystem::path secured_;  // empty: nothing but its own names leads to it
  std::string problem_;            // of the last look
  int copy_looks_ = 0;
};

std::filesystem::path kept_folder_of(const std::filesystem::path& database);

// Before the database is opened, of a station that was killed. Does not throw.
void settle_kept_files(const std::filesystem::path& database);

// What was set aside, now or earlier (station.kept-1, …): each holds a database with what a station had recorded.
std::vector<std::filesystem::path> folders_set_aside(const std::filesystem::path& database);

}  // namespace server::storage
