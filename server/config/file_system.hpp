// Which file system a folder is on, and whether a store can be there.
//
// A store needs locks that hold, hard links and a sync that means what it says (server/storage/database). Network file
// systems and FAT do not give them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace server::config {

// "NFS", "SMB" or "FAT" by the type of statfs(2); empty: nothing speaks against it.
std::string unsuitable_file_system(std::uint64_t type);
std::string unsuitable_file_system(const std::filesystem::path& folder);  // of the nearest one that is there

// What is said of it, and what to do.
std::string unsuitable_in_words(const std::string& file_system, const std::filesystem::path& folder);

}  // namespace server::config
