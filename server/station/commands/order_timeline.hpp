// The orders that one robot has yet to carry out, by time: running schedules, timed commands that wait, and commands on
// their way.
//
// It holds the accepted schedules itself; everything else it reads from the robot's commands. Loop thread.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>

#include "server/station/commands/orders_ahead.hpp"
#include "server/station/commands/robot_commands.hpp"

namespace server::station {

class OrderTimeline {
 public:
  // A robot has connected: samples show nothing before this time of its clock.
  void begin_connection(std::uint64_t at_robot_us) { next_sample_at_robot_us_ = at_robot_us; }
  void clear() { schedules_.clear(); }  // another boot

  // When the robot makes its next sample, as far as it is known.
  std::uint64_t next_sample_at_robot_us() const { return next_sample_at_robot_us_; }
  void note_samples(std::uint64_t next_sample_at_robot_us);

  // What begins and ends the schedules: an acknowledgement, an event, a refusal. Those that have begun before the time
  // end. `tick_us` is the robot's sample period.
  void note_accepted(const std::shared_ptr<PendingCommand>& accepted, std::uint32_t tick_us);
  void note_event(const protocol::Event& event);
  void drop_schedule(CommandId id);

  // What telemetry does not show yet, but what the robot drops before its time, and what `newer`, when there is one,
  // would take back. Points into the commands.
  OrdersAhead ahead(const RobotState& robot, const RobotCommands& commands,
                    const protocol::Command* newer = nullptr) const;

  // Whether the first setpoint that waits for its time is no longer within a step of where the robot has been driven.
  bool begins_too_far_away(const RobotState& robot, const RobotCommands& commands,
                           const config::CommandLimits& limits) const;

 private:
  // A schedule that the robot has accepted, at the time look_from_robot_us, until it has ended.
  struct AcceptedSchedule {
    std::shared_ptr<PendingCommand> pending;
    std::uint64_t until_robot_us = 0;
  };

  void end_schedules(std::uint64_t at_robot_us);
  bool is_over(const PendingCommand& unanswered) const;

  std::deque<AcceptedSchedule> schedules_;  // for the time at power; oldest first
  std::uint64_t next_sample_at_robot_us_ = 0;
  std::uint64_t schedules_ended_by_ = 0, timed_dropped_by_ = 0;  // numbers of the newest accepted that do so
};

}  // namespace server::station
