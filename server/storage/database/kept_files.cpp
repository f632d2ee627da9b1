// Hard links, three stats for each commit, and what becomes of the links.
#include "server/storage/database/kept_files.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sqlite3.h>
#include <sys/stat.h>

#include <algorithm>
#include <system_error>
#include <utility>

#include "server/runtime/exceptions.hpp"
#include "server/storage/database/backup_copy.hpp"
#include "server/storage/database/finished_file.hpp"

namespace server::storage {
namespace fs = std::filesystem;

namespace {

constexpr std::array<const char*, 3> kEndings{"", "-wal", "-shm"};
constexpr std::size_t kDatabase = 0, kLog = 1, kIndex = 2;
constexpr int kLooksACopy = 60;  // a look each second

fs::path with_ending(fs::path path, const char* ending) { return path.concat(ending); }

fs::path in_folder(const fs::path& folder, const fs::path& database, std::size_t file) {
  return with_ending(folder / database.filename(), kEndings[file]);
}

// A name beside this one that nothing has.
fs::path free_name(const fs::path& path, const char* ending) {
  for (int number = 1;; ++number) {
    const fs::path name = with_ending(path, ending).concat(fmt::format("-{}", number));
    if (!fs::exists(fs::symlink_status(name))) return name;
  }
}

// The file that another program has put into this place.
void move_aside(const fs::path& path) {
  if (!fs::exists(fs::symlink_status(path))) return;
  const fs::path to = free_name(path, ".foreign");
  fs::rename(path, to);
  spdlog::error("{} was not the station's any more: it is kept as {}", path.string(), to.string());
}

}  // namespace

fs::path kept_folder_of(const fs::path& database) { return fs::path{database}.replace_extension(".kept"); }

std::optional<KeptFiles::Identity> KeptFiles::identity_of(const fs::path& path) {
  struct stat status{};
  if (::stat(path.c_str(), &status) != 0) return std::nullopt;
  return Identity{status.st_dev, status.st_ino};
}

KeptFiles::KeptFiles(const fs::path& database, RescuePlace rescue)
    : database_{fs::absolute(database)}, rescue_{std::move(rescue)} {
  for (std::size_t file = 0; file < kEndings.size(); ++file) {
    open_[file] = identity_of(with_ending(database_, kEndings[file])).value_or(Identity{});
  }
  link();
}

void KeptFiles::link() {
  const fs::path folder = kept_folder_of(database_);
  try {
    fs::create_directory(folder);
    fs::permissions(folder, fs::perms::owner_all);
    for (std::size_t file = 0; file < kEndings.size(); ++file) {
      const fs::path second = in_folder(folder, database_, file);
      if (open_[file] != Identity{} && identity_of(second) != open_[file])
        fs::create_hard_link(with_ending(database_, kEndings[file]), second);
    }
    secured_ = folder;
  } catch (const fs::filesystem_error& error) {
    secured_.clear();
    spdlog::warn(
        "the files of the database have no second names: {}; should they be removed while the station works, "
        "the database is copied",
        runtime::text_of(error));
  }
}

// One that had no name when the database was opened has none to lose.
bool KeptFiles::has_name(std::size_t file) const {
  return open_[file] == Identity{} || identity_of(with_ending(database_, kEndings[file])) == open_[file];
}

std::string KeptFiles::problem(SQLite::Database& handle) {
  try {
    if (!hold() && has_name(kDatabase)) put_back_log(handle);
    if (hold()) {
      if (!problem_.empty()) {
        spdlog::info("{} is the file again into which the station writes", database_.string());
        link();
      }
      problem_.clear();
      return {};
    }
    secure(handle);
  } catch (const std::exception& error) {
    if (problem_.empty()) spdlog::error("the files of the database: {}", runtime::text_of(error));
  }
  const std::size_t lost = !has_name(kDatabase) ? kDatabase : !has_name(kLog) ? kLog : kIndex;
  const std::string where = secured_.empty() ? "nowhere else: do not end the station before the file is there again"
                                             : fmt::format("in {}", secured_.string());
  problem_ = fmt::format(
      "{} was removed, renamed or replaced while the station works with it. Nothing is acknowledged; what it has "
      "recorded is {}. Put the file back, or stop the station, move what is there to where it was, and start it again",
      with_ending(database_.filename(), kEndings[lost]).string(), where);
  return problem_;
}

// First the names, so that a kill leaves database and log together; then what the log holds goes into the database.
void KeptFiles::put_back_log(SQLite::Database& handle) {
  try {
    for (const std::size_t file : {kLog, kIndex}) {
      if (has_name(file)) continue;
      const fs::path name = with_ending(database_, kEndings[file]);
      move_aside(name);
      fs::create_hard_link(in_folder(kept_folder_of(database_), database_, file), name);
      spdlog::error(
          "{} was removed, renamed or replaced while the station works with it: it is there again, and nothing "
          "is lost. Leave the files of the data folder alone while a station runs",
          name.string());
    }
    sync_folder_of(database_);
  } catch (const std::system_error& error) {
    if (problem_.empty()) spdlog::error("a file does not get its name again: {}", runtime::text_of(error));
  }
  sqlite3_wal_checkpoint_v2(handle.getHandle(), nullptr, SQLITE_CHECKPOINT_PASSIVE, nullptr, nullptr);
}

// Whether the second names are there; where they are not, a copy of what was acknowledged until now.
void KeptFiles::secure(SQLite::Database& handle) {
  const fs::path folder = kept_folder_of(database_);
  const bool is_kept = identity_of(in_folder(folder, database_, kDatabase)) == open_[kDatabase] &&
                       identity_of(in_folder(folder, database_, kLog)) == open_[kLog];
  if (is_kept) {
    secured_ = folder;
  } else if (secured_.empty() || secured_ == folder) {
    secured_.clear();
    copy(handle);
  }
}

void KeptFiles::copy(SQLite::Database& handle) {
  if (copy_looks_++ % kLooksACopy != 0) return;  // it may fail, and takes the disk's time
  std::error_code unknown;
  const fs::path beside = database_.parent_path();
  const fs::path to = fs::is_directory(beside, unknown) ? beside : rescue_.folder;
  if (to.empty() || !fs::is_directory(to, unknown)) {
    spdlog::error("{} is gone, and there is no folder for backups to copy the database into", beside.string());
    return;
  }
  SQLite::Statement pages{handle, "SELECT page_count * page_size FROM pragma_page_count, pragma_page_size"};
  pages.executeStep();
  const auto bytes = static_cast<std::uint64_t>(pages.getColumn(0).getInt64());
  pages.reset();
  if (fs::space(to).available < bytes + rescue_.spare_bytes) {
    spdlog::error("the database has lost its name, and {} has no room for a copy of {} MB", to.string(),
                  bytes / 1'000'000);
    return;
  }
  const Draft draft{to / "station.rescue.part"};
  {
    BackupCopy copy{handle, draft.path()};
    while (!copy.step(BackupCopy::kPagesAtOnce)) continue;
  }
  const fs::path folder = free_name(to / database_.stem(), ".kept");
  fs::create_directory(folder);
  fs::permissions(folder, fs::perms::owner_all);
  finish_file(draft.path(), folder / database_.filename());
  sync_folder_of(folder);
  secured_ = folder;
}

void KeptFiles::remove() {
  std::error_code ignored;
  if (problem_.empty() && hold()) fs::remove_all(kept_folder_of(database_), ignored);
}

namespace {

// Whether a log without its name holds what the database does not: it was written last. Another program that has moved
// it there since has written the database after it.
bool is_newer(const fs::path& log, const fs::path& database) {
  return fs::exists(log) && fs::file_size(log) > 0 && fs::last_write_time(log) > fs::last_write_time(database);
}

}  // namespace

// SAFETY: put back beside a database that has gone on without it, a log would damage that; so it is set aside.
void settle_kept_files(const fs::path& database) {
  const fs::path folder = kept_folder_of(database);
  std::error_code absent;
  if (!fs::exists(folder, absent)) return;
  try {
    const fs::path kept = in_folder(folder, database, kDatabase), kept_log = in_folder(folder, database, kLog);
    const fs::path aside = free_name(fs::path{database}.replace_extension(), ".kept");
    const bool has_its_log = fs::equivalent(kept_log, with_ending(database, kEndings[kLog]), absent);
    const bool is_the_database = fs::equivalent(kept, database, absent);
    if (is_the_database && (has_its_log || !is_newer(kept_log, database))) {
      fs::remove_all(folder);
      return;
    }
    if (is_the_database) fs::remove(kept);  // what is left there is the log alone
    // SAFETY: SQLite would carry out the log of that database in the one that has its name now.
    for (const std::size_t file : {kLog, kIndex}) {
      const fs::path name = with_ending(database, kEndings[file]);
      if (fs::equivalent(in_folder(folder, database, file), name, absent)) fs::remove(name);
    }
    fs::remove(in_folder(folder, database, kIndex));
    fs::rename(folder, aside);
    sync_folder_of(database);
  } catch (const std::system_error& error) {
    spdlog::error("{}: {}", folder.string(), runtime::text_of(error));
  }
}

std::vector<fs::path> folders_set_aside(const fs::path& database) {
  const std::string begin = database.stem().string() + ".kept-";
  std::vector<fs::path> found;
  std::error_code unreadable;
  for (const auto& entry : fs::directory_iterator{fs::absolute(database).parent_path(), unreadable}) {
    if (entry.path().filename().string().starts_with(begin)) found.push_back(entry.path());
  }
  std::ranges::sort(found);
  return found;
}

}  // namespace server::storage
