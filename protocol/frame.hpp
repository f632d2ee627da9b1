// Frames on a byte stream, the format of protobuf's own delimited streams.
//
//   stream  := frame*
//   frame   := length payload
//   length  := varint, 1 or 2 bytes, value 0..1024
//   payload := `length` bytes, one RobotFrame or StationFrame
//
// There is no checksum and no resynchronising: TCP and TLS keep the bytes right, so a length over the limit means that
// the peer speaks something else, and the connection is closed.
#pragma once

#include <array>

#include "protocol/messages.hpp"

namespace protocol {

constexpr std::size_t kMaxPrefixBytes = 2;
constexpr std::size_t kMaxFramedBytes = kMaxPrefixBytes + kMaxFrameBytes;

// Cuts a byte stream into payloads, whatever the pieces in which it arrives. Owns one frame; allocates nothing.
class FrameReader {
 public:
  enum class State {
    incomplete,  // all input is used, the frame needs more
    complete,    // payload() holds a frame; the rest of the input is untouched
    oversize,    // the length is over kMaxFrameBytes: final, every later push() says so again
  };

  // Takes bytes from the front of `input` up to the end of the next frame.
  State push(Bytes& input);

  // The payload of the frame that push() completed; valid until the next push() or reset().
  Bytes payload() const { return {buffer_.data(), length_}; }

  // Forgets everything, for a new connection.
  void reset() { *this = FrameReader{}; }

 private:
  enum class Phase { length, payload, oversize };

  std::array<std::uint8_t, kMaxFrameBytes> buffer_{};
  std::size_t length_ = 0;
  std::size_t filled_ = 0;
  unsigned shift_ = 0;
  Phase phase_ = Phase::length;
};

// Writes length and payload to `out`; returns the number of bytes, or 0 when they do not fit.
std::size_t write_frame(const RobotFrame& frame, std::uint8_t* out, std::size_t capacity);
std::size_t write_frame(const StationFrame& frame, std::uint8_t* out, std::size_t capacity);

}  // namespace protocol
