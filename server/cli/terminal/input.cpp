// Block by block, so that no more is read than is allowed.
#include "server/cli/terminal/input.hpp"

#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <stdexcept>

#include "base/json_text.hpp"
#include "base/nesting.hpp"

namespace server::cli {
namespace {

constexpr std::size_t kMaxJsonBytes = 1 << 20;

[[noreturn]] void refuse(const std::string& file, const std::string& why) {
  throw std::runtime_error{fmt::format("{}: {}", file, why)};
}

}  // namespace

std::string read_text(const std::string& file, std::size_t max_bytes) {
  if (std::filesystem::is_directory(file)) refuse(file, "is a folder; give a file");
  std::ifstream from_file;
  if (file != "-") from_file.open(file, std::ios::binary);
  std::istream& stream = file == "-" ? std::cin : from_file;
  if (!stream) refuse(file, fmt::format("cannot be read: {}", std::strerror(errno)));
  std::string text;
  for (std::array<char, 65536> block{}; stream.read(block.data(), block.size()) || stream.gcount() > 0;) {
    text.append(block.data(), static_cast<std::size_t>(stream.gcount()));
    if (text.size() > max_bytes) refuse(file, fmt::format("has more than {} bytes", max_bytes));
  }
  if (stream.bad()) refuse(file, fmt::format("cannot be read: {}", std::strerror(errno)));
  return text;
}

nlohmann::json read_json(const std::string& file) {
  const std::string text = read_text(file, kMaxJsonBytes);
  if (base::is_json_deeper(text, base::kMostJsonDepth)) {
    refuse(file, fmt::format("has lists and objects in each other, more than {} deep", base::kMostJsonDepth));
  }
  try {
    return nlohmann::json::parse(text);
  } catch (const nlohmann::json::exception& error) {
    refuse(file, "is not JSON: " + base::fault_of(error));
  }
}

}  // namespace server::cli
