// Blocks are allocated, not only a length: a hole would hold no room.
#include "server/storage/database/disk_reserve.hpp"

#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

namespace server::storage {
namespace fs = std::filesystem;

fs::path disk_reserve_of(const fs::path& database) { return fs::absolute(database).parent_path() / "rheonaut.reserve"; }

void give_up_disk_reserve(const fs::path& database, std::uint64_t free_bytes) {
  std::error_code failed;
  if (free_bytes >= kDiskReserveBytes || !fs::remove(disk_reserve_of(database), failed)) return;
  spdlog::warn("the disk is full; the room that was kept for this start is used");
}

void keep_disk_reserve(const fs::path& database, std::uint64_t free_bytes) {
  constexpr std::uint64_t kPlenty = 10 * kDiskReserveBytes;
  const fs::path path = disk_reserve_of(database);
  std::error_code failed;
  const auto size = fs::file_size(path, failed);
  if ((!failed && size == kDiskReserveBytes) || free_bytes < kPlenty) return;
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0600);
  if (file < 0) return;
  const bool is_held = ::posix_fallocate(file, 0, static_cast<off_t>(kDiskReserveBytes)) == 0;
  ::close(file);
  if (!is_held) fs::remove(path, failed);
}

}  // namespace server::storage
