// By base::read_whole; a file of another user is refused with its owner.
#include "server/cli/terminal/input.hpp"

#include <fmt/format.h>

#include <iostream>
#include <stdexcept>
#include <utility>

#include "base/json_text.hpp"
#include "base/nesting.hpp"
#include "base/whole_file.hpp"
#include "server/runtime/private_file.hpp"

namespace server::cli {
namespace {

constexpr std::size_t kMaxJsonBytes = 1 << 20;

[[noreturn]] void refuse(const std::string& file, const std::string& why) {
  throw std::runtime_error{fmt::format("{}: {}", file, why)};
}

}  // namespace

std::string read_text(const std::string& file, std::size_t max_bytes) {
  base::WholeFile whole = file == "-" ? base::read_whole(std::cin, max_bytes) : base::read_whole(file, max_bytes);
  if (whole.error != 0) refuse(file, "cannot be read: " + runtime::denial(file, whole.error));
  if (!whole.problem.empty()) refuse(file, whole.problem);
  return std::move(whole.text);
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
