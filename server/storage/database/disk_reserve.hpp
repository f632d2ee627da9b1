// Room on the disk for the next start, held by a file of 1 MB beside the database (`rheonaut.reserve`).
//
// SQLite needs some room to open its log again. SAFETY: a station that was killed on a disk that is full to the last
// byte must start all the same, since robots are stopped through it; so the file is given up then, and made again when
// there is room. Any thread, one at a time.
#pragma once

#include <cstdint>
#include <filesystem>

namespace server::storage {

inline constexpr std::uint64_t kDiskReserveBytes = 1'000'000;

std::filesystem::path disk_reserve_of(const std::filesystem::path& database);

// Before the database is opened: removes the file when the disk has less room than it is long. Does not throw.
void give_up_disk_reserve(const std::filesystem::path& database, std::uint64_t free_bytes);

// Makes the file when it is not there, and there is room for ten of it. What fails leaves nothing behind and is tried
// again the next time. Does not throw.
void keep_disk_reserve(const std::filesystem::path& database, std::uint64_t free_bytes);

}  // namespace server::storage
