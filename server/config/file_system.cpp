// Asks the kernel.
#include "server/config/file_system.hpp"

#include <fmt/format.h>
#include <sys/vfs.h>

#include <system_error>

namespace server::config {
namespace fs = std::filesystem;

std::string unsuitable_file_system(std::uint64_t type) {
  switch (type & 0xFFFFFFFF) {  // statfs(2); some systems give it with a sign
    case 0x6969: return "NFS";
    case 0x517B:
    case 0xFF534D42:
    case 0xFE534D42: return "SMB";
    case 0x4D44:
    case 0x2011BAB0: return "FAT";
    default: return {};
  }
}

std::string unsuitable_file_system(const fs::path& folder) {
  std::error_code ignored;
  fs::path there = fs::absolute(folder, ignored);
  while (!fs::exists(there, ignored) && there.has_relative_path()) there = there.parent_path();
  struct statfs about{};
  if (::statfs(there.c_str(), &about) != 0) return {};
  return unsuitable_file_system(static_cast<std::uint64_t>(about.f_type));
}

std::string unsuitable_in_words(const std::string& file_system, const fs::path& folder) {
  return fmt::format(
      "'{}' is on {}, where a store can be damaged and samples be lost: locks, links and syncs do not hold there. "
      "Choose a folder on a local disk (ext4, xfs, btrfs)",
      folder.string(), file_system);
}

}  // namespace server::config
