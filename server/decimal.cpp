// By way of the shortest text.
#include "server/decimal.hpp"

#include <charconv>
#include <cmath>

namespace server {

nlohmann::json decimal(float value) {
  if (!std::isfinite(value)) return nullptr;
  char digits[32];
  const auto written = std::to_chars(digits, digits + sizeof digits, value);
  double shortest = 0;
  std::from_chars(digits, written.ptr, shortest);
  return shortest;
}

}  // namespace server
