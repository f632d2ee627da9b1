// What is known of a robot at one moment: as the station received it, and as simulated.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "protocol/messages.hpp"

namespace sim_robot {

enum class LinkView { none, up, lost };  // none: not yet, or closed and not yet held for lost

struct View {
  double position_m = 0, velocity_m_s = 0;
  double duty = 0;
  double impedance_mv = 0;
  protocol::Mode mode = rheonaut_MODE_UNSPECIFIED;
  std::uint64_t emergency_id = 0;  // 0: not latched
  LinkView link = LinkView::none;

  // What only telemetry says; a core does not show it.
  bool is_truth = false;
  protocol::SubState sub_state = rheonaut_SUB_STATE_NONE;
  std::optional<double> setpoint_m;
  std::uint32_t flags = 0;
};

class SimulatedRobot;
View true_view(const SimulatedRobot& robot);

struct Moment {
  double time_s = 0;               // virtual, since the story began
  View received;                   // the newest that has arrived at the station
  View truth;                      // in the robot and its world now; positions from where it was made
  int connections = 0;             // that have reached the station
  std::uint64_t samples_owed = 0;  // older than the newest that has arrived, and neither arrived nor lost for good
};

// An event of the robot, as the station received it. Kind and cause are spelled as in docs/protocol.md.
struct ReceivedEvent {
  std::string kind, cause;
  double robot_time_s = 0;
  double position_m = 0;
  double value = 0;  // unit by kind
  std::uint64_t emergency_id = 0;
};

// The robot's answer to a command, or why it got none.
struct Answer {
  std::string text;  // "accepted", "expired", "latched", …
  std::uint64_t emergency_id = 0;
  std::uint64_t effect_at_robot_us = 0;
};

}  // namespace sim_robot
