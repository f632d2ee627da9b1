// Throws std::invalid_argument for an argument: what is wrong, its value, and what is allowed.
#pragma once

#include <cmath>
#include <sstream>
#include <stdexcept>
#include <string>

namespace base {

// The parts one after the other, numbers with ten digits.
template <class... Parts>
std::string join_text(const Parts&... parts) {
  std::ostringstream text;
  text.precision(10);
  (text << ... << parts);
  return text.str();
}

template <class... Parts>
[[noreturn]] void throw_invalid(const Parts&... parts) {
  throw std::invalid_argument(join_text(parts...));
}

inline bool is_positive(double value) { return value > 0 && std::isfinite(value); }

}  // namespace base
