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

DataFolder::DataFolder(std::filesystem::path path) : path_{std::move(path)} {
  umask(077);  // of the whole program: SQLite's files, tokens and logs are for this user only, also in an open folder
  std::error_code error;
  const bool made = std::filesystem::create_directories(path_, error);
  if (error)
    throw std::runtime_error{fmt::format("cannot make the data folder '{}': {}", path_.string(), error.message())};
  if (made) std::filesystem::permissions(path_, std::filesystem::perms::owner_all);
  const auto lock_path = path_ / "rheonaut.lock";
  lock_ = open(lock_path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (lock_ < 0)
    throw std::runtime_error{fmt::format("cannot open '{}': {}", lock_path.string(), std::strerror(errno))};
  if (flock(lock_, LOCK_EX | LOCK_NB) != 0) {
    close(lock_);
    throw std::runtime_error{fmt::format(
        "another station runs in '{}'; stop it, or give this one a folder of its own with --data", path_.string())};
  }
  std::filesystem::remove(endpoints());  // of a station that was killed
}

DataFolder::~DataFolder() {
  std::error_code ignored;
  std::filesystem::remove(endpoints(), ignored);
  close(lock_);
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
