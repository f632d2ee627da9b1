#include "server/experiments/runner/command_feed.hpp"

#include <algorithm>
#include <cmath>

namespace server::experiments {
namespace {

constexpr std::size_t kMostEntries = std::size(rheonaut_SetDutySchedule{}.duty);

}  // namespace

CommandFeed::CommandFeed(const TimeLine& line, std::size_t first_step, std::uint64_t begins_at_robot_us,
                         std::uint64_t first_tick)
    : line_{&line},
      first_tick_{std::max(line.step_begins.at(first_step), first_tick)},
      begins_at_robot_us_{begins_at_robot_us} {
  const auto first = std::ranges::find_if(
      line.actions, [&](const Action& one) { return one.step >= first_step && one.tick >= first_tick_; });
  next_ = static_cast<std::size_t>(first - line.actions.begin());
}

std::uint64_t CommandFeed::robot_time_us(std::uint64_t tick) const {
  return begins_at_robot_us_ + (tick - first_tick_) * kTickUs;
}

std::uint64_t CommandFeed::tick_at(std::uint64_t robot_now_us) const {
  if (robot_now_us <= begins_at_robot_us_) return first_tick_;
  return std::min(first_tick_ + (robot_now_us - begins_at_robot_us_) / kTickUs, line_->ticks);
}

std::size_t CommandFeed::step_at(std::uint64_t robot_now_us) const {
  const auto after = std::ranges::upper_bound(line_->step_begins, tick_at(robot_now_us));
  return static_cast<std::size_t>(after - line_->step_begins.begin()) - 1;
}

protocol::Mode CommandFeed::mode_at(std::uint64_t robot_now_us) const {
  const bool has_changed = mode_changes_at_us_ != 0 && robot_now_us >= mode_changes_at_us_;
  const bool now = has_changed || mode_changes_at_us_ == 0 ? is_auto_ : was_auto_;
  return now ? rheonaut_MODE_AUTO : rheonaut_MODE_MANUAL;
}

bool CommandFeed::needs_lease(std::uint64_t robot_now_us) const { return robot_now_us < driven_until_us_; }

bool CommandFeed::is_about_to_drive(std::uint64_t robot_now_us) const {
  if (next_ >= line_->actions.size() || is_held_up(robot_now_us)) return false;
  return line_->actions[next_].kind == ActionKind::duty || !is_auto_;
}

bool CommandFeed::is_over(std::uint64_t robot_now_us) const {
  return next_ >= line_->actions.size() && robot_now_us >= robot_time_us(line_->ticks);
}

// SAFETY: the robot drops what waits when its mode changes, so nothing is sent between that command and its time.
bool CommandFeed::is_held_up(std::uint64_t robot_now_us) const {
  if (robot_now_us < mode_changes_at_us_) return true;
  return robot_time_us(line_->actions[next_].tick) > robot_now_us + kLookAheadUs;
}

std::optional<FedCommand> CommandFeed::next(std::uint64_t robot_now_us) {
  std::erase_if(waiting_, [robot_now_us](std::uint64_t at_us) { return at_us < robot_now_us; });
  while (next_ < line_->actions.size() && waiting_.size() < kMostWaiting && !is_held_up(robot_now_us)) {
    auto fed = is_auto_ ? std::optional{next_in_auto()} : next_in_manual();
    if (!fed) continue;
    waiting_.push_back(fed->command.execute_at_robot_us);
    return fed;
  }
  return std::nullopt;
}

protocol::Command CommandFeed::timed(std::uint64_t tick) const {
  protocol::Command command = rheonaut_Command_init_zero;
  command.has_execute_at_robot_us = true;
  command.execute_at_robot_us = robot_time_us(tick);
  return command;
}

FedCommand CommandFeed::change_mode(bool to_auto) {
  const Action& action = line_->actions[next_++];
  FedCommand fed{timed(action.tick), action.step};
  fed.command.which_action = rheonaut_Command_set_mode_tag;
  auto& order = fed.command.action.set_mode;
  order.mode = to_auto ? rheonaut_MODE_AUTO : rheonaut_MODE_MANUAL;
  order.has_setpoint_m = to_auto;
  order.setpoint_m = to_auto ? static_cast<float>(action.value) : 0;
  was_auto_ = is_auto_;
  is_auto_ = to_auto;
  mode_changes_at_us_ = fed.command.execute_at_robot_us;
  driven_until_us_ = 0;
  return fed;
}

FedCommand CommandFeed::next_in_auto() {
  const Action& action = line_->actions[next_];
  if (action.kind == ActionKind::duty) return change_mode(false);  // at duty 0, see time_line_of
  ++next_;
  FedCommand fed{timed(action.tick), action.step};
  if (action.kind == ActionKind::setpoint) {
    fed.command.which_action = rheonaut_Command_set_setpoint_tag;
    fed.command.action.set_setpoint.setpoint_m = static_cast<float>(action.value);
  } else {
    fed.command.which_action = rheonaut_Command_inject_disturbance_tag;
    fed.command.action.inject_disturbance.disturbance_m = static_cast<float>(action.value);
  }
  return fed;
}

std::optional<FedCommand> CommandFeed::next_in_manual() {
  const Action& action = line_->actions[next_];
  if (action.kind != ActionKind::duty) return change_mode(true);
  const bool is_at_rest = robot_time_us(action.tick) >= driven_until_us_;
  if (action.value != 0 || !is_at_rest) return schedule();
  ++next_;  // it is at duty 0 already
  return std::nullopt;
}

// Up to the last duty before another kind of command, or before there is no room: the last entry is always 0, at the
// time of the next duty if there is one.
FedCommand CommandFeed::schedule() {
  const Action& first = line_->actions[next_];
  FedCommand fed{timed(first.tick), first.step};
  fed.command.which_action = rheonaut_Command_set_duty_schedule_tag;
  auto& order = fed.command.action.set_duty_schedule;
  const auto add = [&order, &first](std::uint64_t tick, double duty) {
    order.tick[order.tick_count++] = static_cast<std::uint32_t>(tick - first.tick);
    order.duty[order.duty_count++] = static_cast<float>(duty);
  };
  std::uint64_t last_tick = line_->ticks;
  while (next_ < line_->actions.size() && line_->actions[next_].kind == ActionKind::duty) {
    const Action& action = line_->actions[next_];
    last_tick = action.tick;
    if (order.tick_count + 1U == kMostEntries) break;  // the rest comes with the next one
    add(action.tick, action.value);
    ++next_;
    const bool is_last = next_ == line_->actions.size() || line_->actions[next_].kind != ActionKind::duty;
    if (is_last && action.value != 0)
      last_tick = next_ < line_->actions.size() ? line_->actions[next_].tick : line_->ticks;
  }
  if (order.duty[order.duty_count - 1] != 0) add(last_tick, 0);
  driven_until_us_ = robot_time_us(first.tick + order.tick[order.tick_count - 1]);
  return fed;
}

// The last action of a step says its mode: the first may be that of the change.
bool is_of_auto(const TimeLine& line, std::size_t step) {
  const auto last = std::ranges::find(line.actions.rbegin(), line.actions.rend(), step, &Action::step);
  return last != line.actions.rend() && last->kind != ActionKind::duty;
}

std::size_t step_to_repeat(const TimeLine& line, std::size_t step) {
  while (step > 0 && is_of_auto(line, step) && is_of_auto(line, step - 1)) --step;
  return step;
}

std::optional<Action> duty_in_force(const TimeLine& line, std::size_t step, std::uint64_t tick) {
  const auto after = std::ranges::upper_bound(line.actions, tick, {}, &Action::tick);
  if (after == line.actions.begin()) return std::nullopt;
  const Action& last = *std::prev(after);
  const bool is_cut = last.step == step && last.kind == ActionKind::duty && last.tick < tick && last.value != 0;
  return is_cut ? std::optional{Action{tick, ActionKind::duty, last.value, step}} : std::nullopt;
}

TimeLine rest_of(const TimeLine& line, std::size_t step, std::uint64_t tick) {
  TimeLine rest = line;
  std::erase_if(rest.actions, [&](const Action& one) { return one.step < step || one.tick < tick; });
  const auto in_force = duty_in_force(line, step, tick);
  if (in_force) rest.actions.insert(rest.actions.begin(), *in_force);
  for (Action& action : rest.actions) action.tick -= tick;
  for (std::uint64_t& begin : rest.step_begins) begin = std::max(begin, tick) - tick;
  rest.ticks -= tick;
  return rest;
}

}  // namespace server::experiments
