// Numbers as decimal text, appended to a string: integers, floats as the shortest decimal that reads back the same, and
// microseconds as seconds.
//
// For text of many numbers; std::to_chars underneath, which is some ten times as fast as a JSON tree.
#pragma once

#include <charconv>
#include <cmath>
#include <concepts>
#include <cstdint>
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

// The part of a second, six digits: 000001.
inline void append_micros(std::string& out, std::int64_t micros) {
  char digits[6];
  for (std::size_t place = 6; place-- > 0; micros /= 10) digits[place] = static_cast<char>('0' + micros % 10);
  out.append(digits, 6);
}

// "12.000001", exactly. `time_us` is not negative.
inline void append_seconds(std::string& out, std::int64_t time_us) {
  constexpr std::int64_t kSecondUs = 1'000'000;
  append_number(out, time_us / kSecondUs);
  out += '.';
  append_micros(out, time_us % kSecondUs);
}

}  // namespace base
