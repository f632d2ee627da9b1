// Makes, locks and announces the data folder.
#include "server/config/data_folder.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstring>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "server/runtime/private_file.hpp"

namespace server::config {
namespace asio = boost::asio;

namespace {

constexpr std::chrono::seconds kAnnounceInterval{2};

FolderLock take_lock(const std::filesystem::path& folder) {
  make_data_folder(folder);
  if (auto lock = FolderLock::try_take(folder)) return std::move(*lock);
  throw std::runtime_error{fmt::format(
      "another station runs in '{}'; stop it, or give this one a folder of its own with --data", folder.string())};
}

}  // namespace

std::optional<FolderLock> FolderLock::try_take(const std::filesystem::path& folder) {
  const auto path = folder / "rheonaut.lock";
  const int file = open(path.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0600);
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
  runtime::require_own_folder(path);
}

DataFolder::DataFolder(std::filesystem::path path) : path_{std::move(path)}, lock_{take_lock(path_)} {
  std::filesystem::remove(endpoints());  // of a station that was killed
}

DataFolder::~DataFolder() {
  std::error_code ignored;
  std::filesystem::remove(endpoints(), ignored);
}

asio::awaitable<void> DataFolder::announce(runtime::Clock& clock, Announcement announcement) {
  nlohmann::json content{{"http", announcement.http}, {"robots", announcement.robots}, {"pid", getpid()}};
  if (!announcement.tls_certificate.empty()) content["tls_certificate"] = announcement.tls_certificate;
  if (!announcement.robots_tls_certificate.empty()) {
    content["robots_tls_certificate"] = announcement.robots_tls_certificate;
  }
  for (bool warned = false; !write_endpoints(content.dump() + '\n'); warned = true) {
    if (!warned) {
      spdlog::warn("'{}' cannot be written, programs on this machine do not find the station at {} until there is room",
                   endpoints().string(), announcement.http);
    }
    co_await clock.sleep_for(kAnnounceInterval);
  }
}

bool DataFolder::write_endpoints(const std::string& content) const {
  try {
    runtime::write_private(endpoints(), content);
    return true;
  } catch (const std::runtime_error&) {
    return false;
  }
}

}  // namespace server::config
