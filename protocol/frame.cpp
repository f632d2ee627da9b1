// Cuts a byte stream into frames and writes frames to it.
#include "protocol/frame.hpp"

#include <algorithm>
#include <cstring>

namespace protocol {
namespace {

template <class Frame>
std::size_t write_any_frame(const Frame& frame, std::uint8_t* out, std::size_t capacity) {
  // The payload is written behind one byte of length, and moved when it needs two: a buffer would cost 1 kB of stack.
  if (capacity == 0) return 0;
  const std::size_t length = encode(frame, out + 1, std::min(capacity - 1, kMaxFrameBytes));
  const std::size_t prefix = length < 0x80 ? 1 : 2;
  if (length == 0 || prefix + length > capacity) return 0;
  if (prefix == 1) {
    out[0] = static_cast<std::uint8_t>(length);
  } else {
    std::memmove(out + prefix, out + 1, length);
    out[0] = static_cast<std::uint8_t>(0x80 | (length & 0x7F));
    out[1] = static_cast<std::uint8_t>(length >> 7);
  }
  return prefix + length;
}

}  // namespace

FrameReader::State FrameReader::push(Bytes& input) {
  if (phase_ == Phase::oversize) return State::oversize;
  if (phase_ == Phase::payload && filled_ == length_) {  // the frame of the last call was taken
    phase_ = Phase::length;
    length_ = filled_ = 0;
    shift_ = 0;
  }
  while (phase_ == Phase::length) {
    if (input.empty()) return State::incomplete;
    const std::uint8_t byte = *input.first;
    input.drop(1);
    length_ |= static_cast<std::size_t>(byte & 0x7F) << shift_;
    shift_ += 7;
    const bool more = (byte & 0x80) != 0;
    if (length_ > kMaxFrameBytes || (more && shift_ >= 7 * kMaxPrefixBytes)) {
      phase_ = Phase::oversize;
      return State::oversize;
    }
    if (!more) phase_ = Phase::payload;
  }
  const std::size_t count = std::min(length_ - filled_, input.size);
  if (count > 0) std::memcpy(buffer_.data() + filled_, input.first, count);
  filled_ += count;
  input.drop(count);
  return filled_ == length_ ? State::complete : State::incomplete;
}

std::size_t write_frame(const RobotFrame& frame, std::uint8_t* out, std::size_t capacity) {
  return write_any_frame(frame, out, capacity);
}

std::size_t write_frame(const StationFrame& frame, std::uint8_t* out, std::size_t capacity) {
  return write_any_frame(frame, out, capacity);
}

}  // namespace protocol
