// Reads protobuf where it lies; what is cut short reads as 0.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>

namespace bare {

class WireReader {
 public:
  WireReader(const std::uint8_t* first, const std::uint8_t* end) : at_(first), end_(end) {}
  bool more() const { return at_ < end_; }
  std::uint64_t varint() {
    std::uint64_t value = 0;
    for (unsigned shift = 0; at_ < end_ && shift < 64; shift += 7) {
      const std::uint8_t byte = *at_++;
      value |= std::uint64_t{byte & 0x7FU} << shift;
      if (byte < 0x80) break;
    }
    return value;
  }
  template <class Number>
  Number fixed() {
    Number value{};
    if (end_ - at_ >= static_cast<std::ptrdiff_t>(sizeof value)) std::memcpy(&value, at_, sizeof value);
    skip(sizeof value);
    return value;
  }
  WireReader message() {
    const std::uint64_t size = varint();
    const std::uint8_t* const first = at_;
    skip(size);
    return {first, at_};
  }
  const std::uint8_t* at() const { return at_; }
  std::size_t size() const { return static_cast<std::size_t>(end_ - at_); }
  void skip_value(unsigned wire_type) {
    if (wire_type == 0) varint();
    if (wire_type == 1) skip(8);
    if (wire_type == 2) message();
    if (wire_type == 5) skip(4);
  }

 private:
  void skip(std::uint64_t count) { at_ += std::min<std::uint64_t>(count, static_cast<std::uint64_t>(end_ - at_)); }
  const std::uint8_t* at_;
  const std::uint8_t* end_;
};

}  // namespace bare
