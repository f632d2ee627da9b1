// Writes beside, syncs, renames.
#include "server/runtime/private_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace server::runtime {
namespace fs = std::filesystem;

namespace {

[[noreturn]] void cannot(const char* what, const fs::path& file) {
  throw std::runtime_error{fmt::format("cannot {} {}: {}", what, file.string(), std::strerror(errno))};
}

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

}  // namespace server::runtime
