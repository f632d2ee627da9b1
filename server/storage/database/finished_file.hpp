// A file that others may use becomes visible whole or not at all, and stays after a power cut.
#pragma once

#include <array>
#include <filesystem>

namespace server::storage {

// Syncs the file `part`, renames it to `path`, and syncs the folder. Throws std::system_error.
void finish_file(const std::filesystem::path& part, const std::filesystem::path& path);

// The folder that this file is in: its name stays after a power cut. Throws std::system_error.
void sync_folder_of(const std::filesystem::path& path);

// Moves a whole file; both folders are synced. To another disk it is copied, and is there under its name when it has
// been read back from there. Throws std::system_error, or std::runtime_error when what is read is not what was written.
void move_finished(const std::filesystem::path& from, const std::filesystem::path& to);
// The copy of that, by itself.
void copy_finished(const std::filesystem::path& from, const std::filesystem::path& to);
// Whether the two files hold the same bytes, the second as the disk has it.
bool holds_the_same(const std::filesystem::path& file, const std::filesystem::path& copy);

// Endings of a database that is not complete, and of what SQLite has put beside it.
inline constexpr std::array kDraftSuffixes{"", "-journal", "-wal", "-shm"};
// Removes these files.
void remove_draft(const std::filesystem::path& part);

// The same at the end of a scope, and before: whatever happens, nothing is left of it.
class Draft {
 public:
  explicit Draft(std::filesystem::path path) : path_{std::move(path)} { remove_draft(path_); }
  ~Draft() { remove_draft(path_); }
  Draft(const Draft&) = delete;
  Draft& operator=(const Draft&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace server::storage
