// Finds impossible values in a decoded frame of a robot, before anything computes with them.
//
// They do not end the link: a robot repeats what is not acknowledged, so the same frame would end the next link, too.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "protocol/messages.hpp"
#include "server/station/state/checked.hpp"

namespace server::station {

// How far the numbers of a robot's next frame can have come. A robot counts without leaps, so one that is far ahead of
// all before it cannot be: if it were taken, every true one after it would look old. Never above kMaxRobotNumber.
struct FrameReach {
  // Beyond what any outage within a connection makes.
  static constexpr std::uint64_t kEventLeap = 1'000'000;
  static constexpr std::uint64_t kTimeLeapUs = 3'600'000'000;
  // How much further than by its time a sample's number may be; a false one that is taken keeps its boot from
  // connecting again until that number is reached: at 100 Hz for a minute at most.
  static constexpr std::uint64_t kSeqSlack = 6'000;

  std::uint64_t next_seq = kMaxRobotNumber;  // after the latest sample
  std::uint64_t sampled_at_us = 0;           // by then, in the robot's time
  std::uint64_t event_seq = kMaxRobotNumber;
  std::uint64_t robot_time_us = kMaxRobotNumber;

  // Of the frames after a hello, or after this frame, which was mended and has a number.
  static FrameReach after(const protocol::Hello& hello, std::uint64_t robot_time_us);
  void advance(const protocol::RobotFrame& frame);

  // The largest that these can be: the first_seq of this batch, the sample_seq of an event.
  std::uint64_t first_seq(const protocol::Telemetry& batch) const;
  std::uint64_t sample_seq() const;
};

struct FrameFaults {
  std::uint64_t count = 0;   // values that cannot be; 0: all can
  const char* cause = "";    // of the first: not_finite, out_of_range
  std::string first;         // in words
  bool is_unusable = false;  // the frame's samples, or its event, cannot be recorded
  bool has_number = true;    // ... but it is known which they are

  // What the frame holds, unless it is unusable.
  std::optional<Checked<protocol::Telemetry>> samples;
  std::optional<Checked<protocol::Event>> event;
};

// Finds them. A number or time that cannot be and is not needed becomes 0, which says nothing.
FrameFaults mend(protocol::RobotFrame& frame, const FrameReach& reach);

}  // namespace server::station
