// A file is sent as it is.
#include "server/cli/experiments/profile_file.hpp"

#include <filesystem>

#include "server/cli/terminal/input.hpp"

namespace server::cli {

constexpr std::size_t kMaxProfileBytes = 1 << 20;

std::string profile_document(const std::string& name_or_file) {
  const bool is_path = name_or_file.find_first_of("./") != std::string::npos;  // no profile's name has one
  std::error_code hidden;
  if (!is_path && !std::filesystem::is_regular_file(name_or_file, hidden)) return name_or_file;
  return read_text(name_or_file, kMaxProfileBytes) + "\n";
}

}  // namespace server::cli
