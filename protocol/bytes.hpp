// A view of bytes that someone else owns, for C++17 code that cannot use std::span.
#pragma once

#include <cstddef>
#include <cstdint>

namespace protocol {

struct Bytes {
  const std::uint8_t* first = nullptr;
  std::size_t size = 0;

  const std::uint8_t* begin() const { return first; }
  const std::uint8_t* end() const { return first + size; }
  bool empty() const { return size == 0; }

  // Drops the first `count` bytes; count ≤ size.
  void drop(std::size_t count) {
    first += count;
    size -= count;
  }
};

}  // namespace protocol
