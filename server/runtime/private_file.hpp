// Files that hold secrets: written completely or not at all, and readable by their owner only.
#pragma once

#include <filesystem>
#include <string>

namespace server::runtime {

// The whole file or nothing appears under its name, readable by its owner only from the first moment; what was there
// before is replaced. Throws std::runtime_error that names the file.
void write_private(const std::filesystem::path& file, const std::string& content);

}  // namespace server::runtime
