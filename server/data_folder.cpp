// Makes, locks and announces the data folder.
#include "server/data_folder.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace server {

namespace {

FolderLock take_lock(const std::filesystem::path& folder) {
  make_data_folder(folder);
  if (auto lock = FolderLock::try_take(folder)) return std::move(*lock);
  throw std::runtime_error{fmt::format(
      "another station runs in '{}'; stop it, or give this one a folder of its own with --data", folder.string())};
}

}  // namespace

std::optional<FolderLock> FolderLock::try_take(const std::filesystem::path& folder) {
  const auto path = folder / "rheonaut.lock";
  const int file = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (file < 0) throw std::runtime_error{fmt::format("cannot open '{}': {}", path.string(), std::strerror(errno))};
  if (flock(file, LOCK_EX | LOCK_NB) == 0) return FolderLock{file};
  close(file);
  return std::nullopt;
}

FolderLock::~FolderLock() {
  if (file_ >= 0) close(file_);
}

void make_data_folder(const std::filesystem::path& path) {
  umask(077);  // of the whole program: SQLite's files, tokens and logs are for this user only, also in an open folder
  std::error_code error;
  const bool made = std::filesystem::create_directories(path, error);
  if (error)
    throw std::runtime_error{fmt::format("cannot make the data folder '{}': {}", path.string(), error.message())};
  if (made) std::filesystem::permissions(path, std::filesystem::perms::owner_all);
}

DataFolder::DataFolder(std::filesystem::path path) : path_{std::move(path)}, lock_{take_lock(path_)} {
  std::filesystem::remove(endpoints());  // of a station that was killed
}

DataFolder::~DataFolder() {
  std::error_code ignored;
  std::filesystem::remove(endpoints(), ignored);
}

void DataFolder::announce(const std::string& http, const std::string& robots) {
  const nlohmann::json content{{"http", http}, {"robots", robots}, {"pid", getpid()}};
  const auto draft = path_ / "endpoints.json.new";
  std::ofstream out{draft};
  out << content.dump() << '\n';
  out.close();
  if (!out) throw std::runtime_error{fmt::format("cannot write '{}'", draft.string())};
  std::filesystem::rename(draft, endpoints());
}

}  // namespace server
