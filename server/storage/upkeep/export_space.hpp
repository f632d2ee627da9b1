// Whether a run has room on the disk as a file: before its export begins, and before each slice of it.
//
// On any thread; it asks the file system.
#pragma once

#include <cstdint>
#include <filesystem>

#include "server/runtime/result.hpp"

namespace server::storage {

// Twice what these samples need in any format, and what the recording goes on with. unavailable (low_space).
Result<void> room_for_export(const std::filesystem::path& folder, std::uint64_t samples);

// Nobody knows before how long the gaps of a grid are. unavailable (low_space).
Result<void> room_for_more(const std::filesystem::path& folder);

}  // namespace server::storage
