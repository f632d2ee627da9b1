// One command from its submission to its end: its record, its frame, and the answer or effect that it waits for.
//
// Times are steady times of the station unless the name says robot. Loop thread.
#pragma once

#include <boost/asio/io_context.hpp>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>

#include "server/runtime/clock.hpp"
#include "server/station/commands/recent_commands.hpp"
#include "server/station/commands/requests.hpp"

namespace server::station {

// The submitter waits for its answer, or its end. Shared by the robot's entry and the submitter, since either may go
// first.
struct PendingCommand {
  explicit PendingCommand(boost::asio::io_context& loop) : answered{loop}, ended{loop} {}

  bool is_stop() const { return wire.which_action == rheonaut_Command_emergency_stop_tag; }
  bool is_timed_order() const { return wire.has_execute_at_robot_us; }
  const char* expiry() const { return dropped_because == nullptr ? "expired" : dropped_because; }

  CommandRecord record;
  protocol::Command wire = rheonaut_Command_init_zero;
  std::int64_t deadline_us = std::numeric_limits<std::int64_t>::max();    // of its time to live
  std::int64_t answer_due_us = std::numeric_limits<std::int64_t>::max();  // sent: of the robot's answer
  std::uint64_t number = 0;         // counts the commands of its robot: a stop of a higher number was asked for later
  std::int64_t received_us = 0;     // when the request arrived at the station
  std::int64_t handed_at_us = 0;    // a stop: when it was last given to the link
  std::int64_t seen_after_us = -1;  // sent: from received_us until samples proved that it has run; -1: they did not
  std::uint64_t look_from_robot_us = 0;   // sent, acknowledged: older telemetry shows nothing of it
  std::uint64_t look_until_robot_us = 0;  // sent: nor does telemetry from here on
  std::int64_t seen_until_us = 0;         // acknowledged: then it is no longer looked for
  bool has_key = false;                   // of the client
  bool is_by_holder = false;              // it was sent by right of control, which its actor had
  bool is_timed = false;                  // a stop that counts in Station::stop_times()
  bool is_overtaken = false;              // acknowledged, and a later one that moves the motor too
  bool is_proved_by_samples = false;      // sent: samples that show its effect prove that it has run
  const char* dropped_because = nullptr;  // timed: why the station has it dropped; null: it does not
  runtime::Signal answered, ended;
};

// The robot's time now: of its latest frame and what has passed since. Never ahead of the robot's own clock.
std::int64_t robot_now_us(const RobotState& robot, const runtime::Clock& clock);

// Draws the id, names the boot, and computes the expiry from the latest robot time; a stop does not expire.
std::shared_ptr<PendingCommand> make_pending(boost::asio::io_context& loop, const runtime::Clock& clock,
                                             const CommandRequest& request, const RobotState& robot);

// A command that was answered before, for a request that repeats it.
std::shared_ptr<PendingCommand> answered_before(boost::asio::io_context& loop, const CommandRecord& record);

// Writes the end into the record and resumes the coroutine that waits for it. The caller publishes the record.
void end_command(PendingCommand& pending, CommandState state, std::string reason, const runtime::Clock& clock,
                 RecentCommands& recent);

// Of the setpoints, and of the duties, that wait for the link only the newest is sent.
bool is_superseded_by(const PendingCommand& older, const protocol::Command& newer);

}  // namespace server::station
