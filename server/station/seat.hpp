// One robot's place in the station: its port while it is connected, and its commands on their way.
#pragma once

#include <deque>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include "server/station/state/in_force.hpp"
#include "server/station/station.hpp"

namespace server {

// A command from submission to its end; the submitter waits for its answer, or its end. Shared by the seat and the
// submitter, since either may go first.
struct PendingCommand {
  explicit PendingCommand(boost::asio::io_context& loop) : answered{loop}, ended{loop} {}

  bool is_stop() const { return wire.which_action == rheonaut_Command_emergency_stop_tag; }
  const char* expiry() const { return dropped_because == nullptr ? "expired" : dropped_because; }

  CommandRecord record;
  protocol::Command wire = rheonaut_Command_init_zero;
  std::int64_t deadline_us = std::numeric_limits<std::int64_t>::max();  // steady
  std::uint64_t number = 0;         // counts the commands of its seat: a stop of a higher number was asked for later
  std::int64_t received_us = 0;     // steady, when the request arrived at the station
  std::int64_t handed_at_us = 0;    // a stop: when it was last given to the link
  std::int64_t seen_after_us = -1;  // sent: from received_us until samples proved that it has run; -1: they did not
  std::uint64_t look_from_robot_us = 0;   // sent, acknowledged: older telemetry shows nothing of it
  std::uint64_t look_until_robot_us = 0;  // sent: nor does telemetry from here on
  std::int64_t seen_until_us = 0;         // steady; acknowledged: then it is no longer looked for
  bool has_key = false;                   // of the client
  bool is_by_holder = false;              // it was sent by right of control, which its actor had
  bool is_timed = false;                  // a stop that counts in Station::stop_times()
  bool is_overtaken = false;              // acknowledged, and a later one that moves the motor too
  bool is_proved_by_samples = false;      // sent: samples that show its effect prove that it has run
  const char* dropped_because = nullptr;  // timed: why the station has it dropped; null: it does not
  Signal answered, ended;
};

// Of the setpoints, and of the duties, that wait for the link only the newest is sent.
bool is_superseded_by(const PendingCommand& older, const protocol::Command& newer);

// A schedule that the robot has accepted, at the time look_from_robot_us, until it has ended.
struct AcceptedSchedule {
  std::shared_ptr<PendingCommand> pending;
  std::uint64_t until_robot_us = 0;
};

struct Seat {
  RobotState* robot = nullptr;                                    // in Station::robots_
  RobotPort* port = nullptr;                                      // null while disconnected
  std::map<CommandId, std::shared_ptr<PendingCommand>> commands;  // that no robot has answered
  std::deque<std::shared_ptr<PendingCommand>> unseen;             // acknowledged, to be seen in telemetry; oldest first
  std::deque<std::shared_ptr<PendingCommand>> unread;             // acknowledged, to be read back; oldest first
  std::deque<std::shared_ptr<PendingCommand>> unknown;            // of this boot, ended in this state; oldest first
  std::deque<AcceptedSchedule> schedules;                         // for the time at power; oldest first
  RobotSettings settings;                                         // as the robot said last
  std::set<std::string> told_in_force;                            // kinds that the robot has said in the connection
  std::uint64_t connected_at_robot_us = 0;                        // by its hello
  std::uint64_t next_sample_at_robot_us = 0;  // when the robot makes its sample next_seq, as far as it is known
  ClockSync clock_sync;                       // of the boot that is, or was last, connected
  ClockRecord clock_recorded;                 // the latest of that boot; boot_id 0: none yet
  std::int64_t utc_minus_steady_us = 0;       // at its latest exchange
  std::uint64_t latch_known_at_robot_us = 0;  // older telemetry says nothing about the latch
  std::uint64_t last_number = 0;
  std::uint64_t schedules_ended_by = 0, timed_dropped_by = 0;  // numbers of the newest accepted that do so
  std::int64_t refusal_told_at_us = 0;                         // steady; 0: never
  std::uint64_t refusals_untold = 0;                           // since
  std::int64_t invalid_told_at_us = 0;                         // likewise, of values that cannot be
  std::uint64_t invalid_untold = 0;
  // Timed commands that may wait on the robot: whose they are (empty: nobody's), and until when one of them may.
  std::string timed_by;
  std::uint64_t timed_until_robot_us = 0;
  const char* drop_timed_because = nullptr;  // why they have to be dropped; null: they need not
  bool has_lost_a_step = false;  // the robot dropped a setpoint of its own accord: another may have built on it
  CommandId drop_timed_id = 0;   // that drops them, until it is acknowledged; 0: none

  // Stops that no robot has acknowledged; the newest, null when there is none, and how many there are.
  std::shared_ptr<PendingCommand> newest_stop() const;
  std::size_t stops() const;
  std::shared_ptr<PendingCommand> on_its_way(CommandId id) const;  // of both; null when it is none of them
  void keep_unknown(std::shared_ptr<PendingCommand> ended);        // which has ended so
  // What telemetry does not show yet, but what the robot drops before its time, and what `newer`, when there is one,
  // would take back. Points into the commands of this seat.
  OrdersAhead orders_ahead(const protocol::Command* newer = nullptr) const;
  bool is_over(const PendingCommand& unanswered) const;
  // What begins and ends the schedules: an acknowledgement, an event, a drop. Those that have begun before the time
  // end.
  void note_accepted(const std::shared_ptr<PendingCommand>& accepted);
  void note_event(const protocol::Event& event);
  void end_schedules(std::uint64_t at_robot_us);
  void drop_schedule(CommandId id);
  bool is_dropped_in_time(const PendingCommand& pending, std::uint64_t at_robot_us) const;
  // Whether the first setpoint that waits for its time is no longer within a step of where the robot has been driven.
  bool begins_too_far_away(const CommandLimits& limits) const;
  // Those that are read back and that the robot may have run, also without an answer yet; in the order in which they
  // were sent.
  std::vector<std::shared_ptr<PendingCommand>> to_be_read_back() const;
};

}  // namespace server
