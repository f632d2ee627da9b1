// A file is sent as it is.
#include "server/cli/experiments/profile_file.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace server::cli {

std::string profile_document(const std::string& name_or_file) {
  const bool is_path = name_or_file.find_first_of("./") != std::string::npos;  // no profile's name has one
  if (!is_path && !std::filesystem::is_regular_file(name_or_file)) return name_or_file;
  std::ifstream file{name_or_file, std::ios::binary};
  std::ostringstream text;
  if (!(file && text << file.rdbuf())) throw std::runtime_error{fmt::format("cannot read '{}'", name_or_file)};
  return text.str() + "\n";
}

}  // namespace server::cli
