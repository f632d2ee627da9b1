// Writes beside, syncs, renames.
#include "server/runtime/private_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <pwd.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace server::runtime {
namespace fs = std::filesystem;

namespace {

constexpr const char* kServiceUser = "rheonaut";
constexpr std::size_t kMaxSecretBytes = 64 * 1024;

[[noreturn]] void cannot(const char* what, const fs::path& file) {
  throw std::runtime_error{fmt::format("cannot {} {}: {}", what, file.string(), denial(file, errno))};
}

// By number where it has no name.
std::string name_of(uid_t user) {
  const passwd* const found = ::getpwuid(user);
  return found != nullptr ? found->pw_name : std::to_string(user);
}

bool is_trusted(uid_t owner) {
  const uid_t self = ::geteuid();
  if (owner == self || owner == 0) return true;
  const passwd* const service = ::getpwnam(kServiceUser);
  return self == 0 && service != nullptr && service->pw_uid == owner;
}

void require_own(const char* what, const fs::path& path, const struct stat& status) {
  const std::string name = path.string();
  if (!is_trusted(status.st_uid)) {
    throw std::runtime_error{fmt::format(
        "{} '{}' belongs to {}, who could put a token of their own there, and this program runs as {}; run it "
        "as {}, or type: sudo chown -R {} '{}'",
        what, name, name_of(status.st_uid), name_of(::geteuid()), name_of(status.st_uid), name_of(::geteuid()), name)};
  }
  if ((status.st_mode & S_IWOTH) != 0) {
    throw std::runtime_error{
        fmt::format("all users may write to {} '{}' (mode {:04o}), so any of them could put a token "
                    "of their own there; type: chmod o-w '{}'",
                    what, name, status.st_mode & 07777U, name)};
  }
}

struct Descriptor {
  explicit Descriptor(int number_in) : number{number_in} {}
  ~Descriptor() {
    if (number >= 0) ::close(number);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int number;
};

}  // namespace

void write_private(const fs::path& file, const std::string& content) {
  const fs::path temporary = file.string() + ".new";
  fs::remove(temporary);
  const int descriptor = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600);
  if (descriptor < 0) cannot("create", temporary);
  const bool written = ::write(descriptor, content.data(), content.size()) == static_cast<ssize_t>(content.size()) &&
                       ::fsync(descriptor) == 0;
  const int error = errno;
  ::close(descriptor);
  errno = error;
  if (!written) cannot("write", temporary);
  fs::rename(temporary, file);
}

std::optional<std::string> read_private(const fs::path& file) {
  const Descriptor opened{::open(file.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC)};
  if (opened.number < 0 && errno == ENOENT) return std::nullopt;
  if (opened.number < 0 && errno == ELOOP)
    throw std::runtime_error{
        fmt::format("'{0}' is a link, which could lead to a file of somebody else; type: rm '{0}'", file.string())};
  if (opened.number < 0) cannot("read", file);
  struct stat status{};
  if (::fstat(opened.number, &status) != 0) cannot("look at", file);
  if (!S_ISREG(status.st_mode)) throw std::runtime_error{fmt::format("'{}' is no file", file.string())};
  require_own("the file", file, status);  // SAFETY: of what was opened, not of what the name may mean by now
  if ((status.st_mode & S_IWGRP) != 0) {
    throw std::runtime_error{
        fmt::format("the group of '{0}' may write to it (mode {1:04o}), so one of them could have put a token there; "
                    "type: rm '{0}'",
                    file.string(), status.st_mode & 07777U)};
  }
  if ((status.st_mode & 077U) != 0 && status.st_uid == ::geteuid()) {
    spdlog::warn("{} was readable by others (mode {:o}); now it is not", file.string(), status.st_mode & 0777U);
    if (::fchmod(opened.number, 0600) != 0) cannot("protect", file);
  }
  const auto bytes = static_cast<std::size_t>(status.st_size);
  if (bytes > kMaxSecretBytes) {
    throw std::runtime_error{fmt::format("'{}' has more than {} bytes: {}", file.string(), kMaxSecretBytes, bytes)};
  }
  std::string content(bytes, '\0');
  const ssize_t size = ::read(opened.number, content.data(), content.size());
  if (size < 0) cannot("read", file);
  content.resize(static_cast<std::size_t>(size));
  return content;
}

std::string denial(const fs::path& path, int error) {
  if (error != EACCES && error != EPERM) return std::strerror(error);
  const fs::path asked = fs::absolute(path).lexically_normal();
  fs::path denied = asked;
  struct stat status{};
  while (::stat(denied.c_str(), &status) != 0 && denied.has_relative_path()) denied = denied.parent_path();
  const std::string owner = name_of(status.st_uid), self = name_of(::geteuid());
  const unsigned mode = status.st_mode & 07777U;
  if (owner == self) {
    return fmt::format("'{0}' has the mode {1:04o}; type: chmod u+rwX '{0}'", denied.string(), mode);
  }
  const std::string give_away =
      denied == asked ? fmt::format(", or type: sudo chown -R {} '{}'", self, denied.string()) : std::string{};
  return fmt::format("'{}' belongs to {} (mode {:04o}), and this program runs as {}; run it as {}{}", denied.string(),
                     owner, mode, self, owner, give_away);
}

std::optional<std::string> denied(const fs::path& path, int mode) {
  if (::eaccess(path.c_str(), mode) == 0 || (errno != EACCES && errno != EPERM)) return std::nullopt;
  return denial(path, errno);
}

bool is_there(const fs::path& path) {
  struct stat status{};
  if (::stat(path.c_str(), &status) == 0) return true;
  if (errno == EACCES)
    throw std::runtime_error{fmt::format("cannot open '{}': {}", path.string(), denial(path, errno))};
  return false;
}

void require_own_folder(const fs::path& folder) {
  struct stat status{};
  if (::stat(folder.c_str(), &status) != 0) cannot("look at", folder);
  require_own("the folder", folder, status);
  if ((status.st_mode & S_IWGRP) == 0) return;
  spdlog::warn(
      "the group of '{}' may write there (mode {:04o}), and so put a token of its own there; chmod g-w '{}' ends that",
      folder.string(), status.st_mode & 07777U, folder.string());
}

}  // namespace server::runtime
