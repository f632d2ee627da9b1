// Makes, locks and announces the data folder.
#include "server/config/data_folder.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "base/whole_file.hpp"
#include "server/runtime/private_file.hpp"

namespace server::config {
namespace asio = boost::asio;

namespace {

constexpr std::chrono::seconds kAnnounceInterval{2};

FolderLock take_lock(const std::filesystem::path& folder) {
  make_data_folder(folder);
  if (auto lock = FolderLock::try_take(folder)) return std::move(*lock);
  throw std::runtime_error{fmt::format("{} uses '{}'; stop it, or choose another folder with --data",
                                       FolderLock::holder(folder), folder.string())};
}

// "rheonaut backup": the program's name and its first argument, if that is no option.
std::string own_command() {
  std::ifstream in{"/proc/self/cmdline", std::ios::binary};
  std::string program, command;
  std::getline(in, program, '\0');
  std::getline(in, command, '\0');
  program = std::filesystem::path{program}.filename().string();
  return command.empty() || command.front() == '-' ? program : program + ' ' + command;
}

std::filesystem::path lock_file(const std::filesystem::path& folder) { return folder / "rheonaut.lock"; }

}  // namespace

std::optional<FolderLock> FolderLock::try_take(const std::filesystem::path& folder) {
  const auto path = lock_file(folder);
  const int file = open(path.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0600);
  if (file < 0) {
    const int error = errno;
    const bool is_usable = eaccess(folder.c_str(), W_OK | X_OK) == 0;
    throw std::runtime_error{
        fmt::format("cannot open '{}': {}", path.string(), runtime::denial(is_usable ? path : folder, error))};
  }
  if (flock(file, LOCK_EX | LOCK_NB) != 0) {
    close(file);
    return std::nullopt;
  }
  const std::string holder = fmt::format("{} (pid {})\n", own_command(), getpid());
  // On a full disk the file stays empty: the lock holds all the same.
  if (ftruncate(file, 0) != 0 || write(file, holder.data(), holder.size()) < 0) spdlog::debug("the lock has no name");
  return FolderLock{file};
}

std::string FolderLock::holder(const std::filesystem::path& folder) {
  constexpr std::size_t kMaxBytes = 4096;  // a name and a number
  const std::string said = base::read_whole(lock_file(folder), kMaxBytes).text;
  const std::string line = said.substr(0, said.find('\n'));
  return line.empty() ? "another program" : line;
}

FolderLock::~FolderLock() {
  if (file_ >= 0) close(file_);
}

void make_data_folder(const std::filesystem::path& path) {
  umask(077);  // of the whole program: SQLite's files, tokens and logs are for this user only, also in an open folder
  std::error_code error;
  const bool made = std::filesystem::create_directories(path, error);
  if (error)
    throw std::runtime_error{
        fmt::format("cannot make the data folder '{}': {}", path.string(), runtime::denial(path, error.value()))};
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
