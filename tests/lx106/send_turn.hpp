// How much the recorded session's board sends after one tick, so that no tick takes long.
//
//   SendTurn turn;
//   while (turn.goes_on()) turn.sent(robot.transmit(out, capacity, now_us));
//
// A turn ends when nothing is due, after a long frame (a batch, a page, a controller, a hello), or after three frames.
// Encoding is most of a tick's work on the chip; what is left over goes out in the next turn, 10 ms later.
#pragma once

#include <cstddef>

namespace robot_fw {

class SendTurn {
 public:
  static constexpr std::size_t kLongFrameBytes = 100;  // an event has at most 85
  static constexpr int kMaxFrames = 3;

  bool goes_on() const { return frames_left_ > 0; }
  // What transmit() returned.
  void sent(std::size_t frame_bytes) {
    const bool is_last = frame_bytes == 0 || frame_bytes >= kLongFrameBytes;
    frames_left_ = is_last ? 0 : frames_left_ - 1;
  }

 private:
  int frames_left_ = kMaxFrames;
};

}  // namespace robot_fw
