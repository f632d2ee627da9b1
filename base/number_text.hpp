// Numbers as decimal text, appended to a string: integers, and floats as the shortest decimal that reads back the same.
//
// For text of many numbers; std::to_chars underneath, which is some ten times as fast as a JSON tree.
#pragma once

#include <charconv>
#include <cmath>
#include <concepts>
#include <string>
#include <string_view>

namespace base {

template <std::integral Number>
void append_number(std::string& out, Number value) {
  char digits[24];
  const auto written = std::to_chars(digits, digits + sizeof digits, value);
  out.append(digits, written.ptr);
}

// `otherwise` stands for what is not finite.
inline void append_float(std::string& out, float value, std::string_view otherwise) {
  if (!std::isfinite(value)) {
    out += otherwise;
    return;
  }
  char digits[24];
  const auto written = std::to_chars(digits, digits + sizeof digits, value);
  out.append(digits, written.ptr);
}

}  // namespace base
