// What a robot's frame holds, once the link has checked its numbers.
//
// A frame is checked once, where it enters the station, and in two steps. protocol/messages decodes it: what has no
// samples, or columns of different length, is no telemetry and does not decode. mend() in frame_faults judges
// the numbers, and it alone makes a Checked. So what the station fills from one (SampleBatch, RobotEvent) has,
// for its receiver:
//
//   telemetry   1 to 25 samples; period_us 1 to kMaxPeriodUs; first_seq and first_robot_time_us ≤ kMaxRobotNumber;
//               oldest_seq ≤ first_seq
//   event       event_seq, event_robot_time_us and sample_seq ≤ kMaxRobotNumber; oldest_event_seq ≤ event_seq
//
// A float may still be NaN.
#pragma once

#include <cstdint>

#include "protocol/messages.hpp"

namespace server::station {

struct FrameFaults;
struct FrameReach;
FrameFaults mend(protocol::RobotFrame& frame, const FrameReach& reach);

// The largest number of a sample or event, and the latest robot time in µs: beyond any boot, and far from SQLite's
// limit.
inline constexpr std::uint64_t kMaxRobotNumber = (std::uint64_t{1} << 62) - 1;
inline constexpr std::uint32_t kMaxPeriodUs = 10'000'000;

// A part of a frame, valid as long as the frame is.
template <class Message>
class Checked {
 public:
  const Message& operator*() const { return *message_; }

 private:
  friend FrameFaults mend(protocol::RobotFrame& frame, const FrameReach& reach);
  explicit Checked(const Message& message) : message_{&message} {}

  const Message* message_;
};

}  // namespace server::station
