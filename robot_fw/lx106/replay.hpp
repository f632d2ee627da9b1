// Replays a recorded session on a core and prints its outputs line by line; the same on host and chip.
//
//   trace := line*
//   line  := "tick " now_us " " checksum       the state of the floats after the tick, in hexadecimal
//          | "sent " now_us " " bytes          one frame, in hexadecimal
//          | "closes " now_us                  the robot wants the connection closed
#pragma once

#include "robot_fw/core/robot.hpp"
#include "robot_fw/lx106/recording.hpp"

namespace robot_fw::lx106 {

class Replay {
 public:
  static constexpr std::uint64_t kBootId = 0x5EED'0106;
  static constexpr std::size_t kMaxLineBytes = 2 * protocol::kMaxFramedBytes + 40;

  Replay();

  // One call of the core, and nothing else: what is timed.
  void play(const Record& record);

  // What the last play() did.
  protocol::Bytes sent() const { return {frame_.data(), sent_bytes_}; }
  // The line of the trace about it; 0 when there is none.
  std::size_t describe(const Record& record, char (&line)[kMaxLineBytes]) const;

  const Robot& robot() const { return robot_; }

 private:
  Robot robot_;
  std::array<std::uint8_t, protocol::kMaxFramedBytes> frame_{};
  std::size_t sent_bytes_ = 0;
  bool wants_connection_ = true;
};

}  // namespace robot_fw::lx106
