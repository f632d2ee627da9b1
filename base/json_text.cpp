// By way of the shortest text.
#include "base/json_text.hpp"

#include <charconv>
#include <cmath>

namespace base {

nlohmann::json decimal(float value) {
  if (!std::isfinite(value)) return nullptr;
  char digits[32];
  const auto written = std::to_chars(digits, digits + sizeof digits, value);
  double shortest = 0;
  std::from_chars(digits, written.ptr, shortest);
  return shortest;
}

std::string dump(const nlohmann::json& value) {
  return value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

// The library's messages begin with its own name in brackets.
std::string fault_of(const nlohmann::json::exception& error) {
  const std::string message = error.what();
  const std::size_t bracket = message.find("] ");
  return bracket == std::string::npos ? message : message.substr(bracket + 2);
}

}  // namespace base
