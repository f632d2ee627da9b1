// The commands of one run, each a little before its time, as the robot can hold them. Pure.
//
//   next() → command with execute_at_robot_us = begins_at + tick · 10 ms                                          (1)
//
// Each is given out kLookAhead before its time, so the link's delay is not in the experiment. SAFETY: what waits on the
// robot does so under a lease of 500 ms, which begins when it is stored and is longer than that: a command for auto
// needs no renewal, and one whose runner is gone never acts later than that. Duties in manual go as schedules of at
// most 64 entries that end at 0; each follows the one before it in the same tick.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "protocol/messages.hpp"
#include "server/experiments/time_line.hpp"

namespace server::experiments {

inline constexpr std::uint64_t kTickUs = 10'000;  // kTick_s
inline constexpr std::uint64_t kLookAheadUs = 400'000;
inline constexpr std::uint64_t kGraceUs = 100'000;  // after its time a command that comes late still runs
inline constexpr std::size_t kMostWaiting = 3;      // commands on the robot; it holds four

struct FedCommand {
  protocol::Command command;  // with its time
  std::size_t step = 0;
};

class CommandFeed {
 public:
  // From a tick of a step on, its beginning if none is given. The robot is in manual at duty 0. The line outlives it.
  CommandFeed(const TimeLine& line, std::size_t first_step, std::uint64_t begins_at_robot_us,
              std::uint64_t first_tick = 0);

  // The next command whose time has come to be sent; none: not now. `robot_now_us` is never ahead of the robot.
  std::optional<FedCommand> next(std::uint64_t robot_now_us);

  // The mode that the robot is in at that time.
  protocol::Mode mode_at(std::uint64_t robot_now_us) const;
  // A duty other than 0 runs or waits: its lease is to be renewed.
  bool needs_lease(std::uint64_t robot_now_us) const;
  // The command that comes next, if it is soon, begins to move the robot: a duty, or a change into auto.
  bool is_about_to_drive(std::uint64_t robot_now_us) const;
  bool is_over(std::uint64_t robot_now_us) const;  // all has been sent, and its time is over

  std::uint64_t tick_at(std::uint64_t robot_now_us) const;  // of the line
  std::size_t step_at(std::uint64_t robot_now_us) const;
  std::uint64_t robot_time_us(std::uint64_t tick) const;  // (1)
  std::uint64_t begins_at_robot_us() const { return begins_at_robot_us_; }

 private:
  protocol::Command timed(std::uint64_t tick) const;
  std::optional<FedCommand> next_in_manual();
  FedCommand next_in_auto();
  FedCommand change_mode(bool to_auto);
  FedCommand schedule();
  bool is_held_up(std::uint64_t robot_now_us) const;

  const TimeLine* line_;
  std::uint64_t first_tick_ = 0;
  std::uint64_t begins_at_robot_us_ = 0;
  std::size_t next_ = 0;                  // of line_.actions
  bool is_auto_ = false;                  // after what was given out
  bool was_auto_ = false;                 // before the last change of mode
  std::uint64_t mode_changes_at_us_ = 0;  // 0: it has not changed yet
  std::uint64_t driven_until_us_ = 0;     // by the last schedule
  std::vector<std::uint64_t> waiting_;    // times of what may still wait on the robot
};

// The first of the steps from which the run can go on after `step` was broken off with the robot at rest in manual: a
// duty begins by itself, of closed-loop steps that follow each other the first.
std::size_t step_to_repeat(const TimeLine& line, std::size_t step);
bool is_of_auto(const TimeLine& line, std::size_t step);

// The duty that is in force at a tick of a step and was set before it; none: another one is set there, or the motor is
// off.
std::optional<Action> duty_in_force(const TimeLine& line, std::size_t step, std::uint64_t tick);

// The rest of a line from a tick of a step on, with the duty in force there, as a line of its own with the same
// steps.
TimeLine rest_of(const TimeLine& line, std::size_t step, std::uint64_t tick);

}  // namespace server::experiments
