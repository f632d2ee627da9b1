// What the station holds of one robot beside its public state: its connection, its commands, and what it has reported.
//
// Plain data of parts that know nothing of each other; the parts of the station act on it. Lives as long as the
// station.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/station/commands/client.hpp"
#include "server/station/commands/order_timeline.hpp"
#include "server/station/commands/robot_commands.hpp"
#include "server/station/event_limit.hpp"
#include "server/station/reported_configuration.hpp"
#include "server/station/state/event_allowance.hpp"
#include "server/station/state/robot_link.hpp"

namespace server::station {

inline constexpr std::int64_t kEventPeriodUs = 10'000'000;  // of refusals, and of values that cannot be

// Timed commands that may wait on the robot: whose they are (without an actor: nobody's), and until when one of them
// may.
struct TimedOrders {
  Client by;
  std::uint64_t until_robot_us = 0;
  const char* drop_because = nullptr;  // why they have to be dropped; null: they need not
  bool has_lost_a_step = false;        // the robot dropped a setpoint of its own accord: another may have built on it
  CommandId drop_id = 0;               // that drops them, until it is acknowledged; 0: none
  bool is_of_earlier_run = false;  // nobody knows whether one waits: the station has restarted since this boot began
};

// An event that was too many. It is recorded as soon as one may be, unless a later one of its kind comes before that.
struct HeldEvent {
  protocol::EventKind kind = rheonaut_EVENT_KIND_UNSPECIFIED;
  RobotEvent event;
};

struct RobotEntry {
  explicit RobotEntry(RobotState& of) : robot{of} {}

  OrdersAhead orders_ahead(const protocol::Command* newer = nullptr) const {
    return orders.ahead(robot, commands, newer);
  }

  RobotState& robot;
  RobotLink* link = nullptr;  // null while disconnected
  RobotCommands commands;
  OrderTimeline orders;
  TimedOrders timed;
  ReportedConfiguration reported;
  std::string moves_for;  // who was in control of this boot last: what it does, it does in their name; empty: nobody
  std::uint64_t connected_at_robot_us = 0;    // by its hello
  std::uint64_t latch_known_at_robot_us = 0;  // older telemetry says nothing about the latch
  EventLimit refusals{kEventPeriodUs};
  EventLimit invalid_values{kEventPeriodUs};
  EventAllowance events;
  std::vector<HeldEvent> held_events;  // one of each kind; oldest first
  LeftOutCount events_left_out;
  ConnectionAllowance connections;
  bool is_connection_recorded = false;  // of the connection that is
  LeftOutCount connections_left_out;
  std::uint64_t next_event_seq = 0;  // of this boot: those from here on have not come before
};

}  // namespace server::station
