// Files that a command is given: whole, of bounded size and depth, since anybody may have written them.
#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>

namespace server::cli {

// "-" is standard input. Throws std::runtime_error that begins with the file's name.
std::string read_text(const std::string& file, std::size_t max_bytes);
nlohmann::json read_json(const std::string& file);

}  // namespace server::cli
