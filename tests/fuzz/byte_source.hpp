// The fuzzer's bytes, taken one after the other as numbers; what lies behind the end is 0.
#pragma once

#include <array>
#include <cmath>
#include <cstring>
#include <iterator>
#include <limits>

#include "protocol/bytes.hpp"

namespace fuzz {

class ByteSource {
 public:
  explicit ByteSource(protocol::Bytes bytes) : rest_(bytes) {}

  bool empty() const { return rest_.empty(); }
  std::uint8_t byte() { return number<std::uint8_t>(); }
  // As many as are left, at most `count`.
  protocol::Bytes bytes(std::size_t count) {
    const protocol::Bytes front{rest_.first, count < rest_.size ? count : rest_.size};
    rest_.drop(front.size);
    return front;
  }
  template <class Number>
  Number number() {
    Number value{};
    const protocol::Bytes front = bytes(sizeof value);
    if (!front.empty()) std::memcpy(&value, front.first, front.size);
    return value;
  }
  // A small step, a value that code trips over, or any float at all.
  float value() {
    const std::uint8_t choice = byte();
    if (choice < 200) return static_cast<float>(static_cast<int>(choice) - 100) / 100;
    constexpr float kOdd[] = {-0.0F,
                              1.5F,
                              -7,
                              100,
                              1e30F,
                              -1e30F,
                              1e-40F,
                              std::numeric_limits<float>::max(),
                              std::numeric_limits<float>::infinity(),
                              -std::numeric_limits<float>::infinity(),
                              std::numeric_limits<float>::quiet_NaN()};
    const std::size_t at = choice - 200U;
    return at < std::size(kOdd) ? kOdd[at] : number<float>();
  }

 private:
  protocol::Bytes rest_;
};

}  // namespace fuzz
