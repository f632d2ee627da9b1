// fsync, rename, fsync.
#include "server/recording/finished_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

namespace server {
namespace {

void sync(const std::filesystem::path& path) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  const bool synced = file >= 0 && ::fsync(file) == 0;
  const int error = errno;
  if (file >= 0) ::close(file);
  if (!synced) throw std::system_error{error, std::generic_category(), "cannot sync " + path.string()};
}

}  // namespace

void finish_file(const std::filesystem::path& part, const std::filesystem::path& path) {
  sync(part);
  std::filesystem::rename(part, path);
  sync(std::filesystem::absolute(path).parent_path());
}

void remove_draft(const std::filesystem::path& part) {
  std::error_code ignored;
  for (const char* suffix : {"", "-journal", "-wal", "-shm"}) {
    std::filesystem::remove(std::filesystem::path{part}.concat(suffix), ignored);
  }
}

}  // namespace server
