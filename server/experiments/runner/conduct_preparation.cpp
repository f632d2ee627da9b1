// What precedes each run: the actor, control, the fluid, the flow, the controller, the model, the place of the robot.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "server/experiments/runner/conduct.hpp"
#include "server/experiments/runner/pump_flow.hpp"

namespace server::experiments {
namespace asio = boost::asio;
using namespace std::chrono_literals;
using nlohmann::json;

namespace {

constexpr microseconds kLook = 200ms, kModelWithin = 30s, kSamplesWithin = 3s, kCommandWithin = 10s,
                       kSettingsWithin = 2s;

}  // namespace

Profile way_back() {
  Profile profile;
  Step step;
  step.kind = StepKind::setpoint;
  step.setpoint_m = 0;
  step.for_s = kWayBack_s;
  profile.steps = {step};
  return profile;
}

RobotLimits limits_of(const station::RobotSettings* settings) {
  RobotLimits limits;
  if (settings == nullptr) return limits;
  const bool is_known = settings->is_controller_current && settings->controller;
  limits.has_reverse = !is_known || settings->controller->duty_min < 0;
  const auto value = [settings](const char* name, float otherwise) {
    return settings->parameters.value(name).value_or(otherwise);
  };
  const float largest_m = value("setpoint_limit_m", limits.setpoint_max_m);
  limits.setpoint_min_m = std::max(-largest_m, value("position_limit_min_m", -largest_m));
  limits.setpoint_max_m = std::min(largest_m, value("position_limit_max_m", largest_m));
  limits.disturbance_max_m = largest_m;
  limits.auto_limit_s = value("auto_limit_s", limits.auto_limit_s);
  return limits;
}

// Of a robot that was away when the experiment was asked for, or was told other limits since: what it would refuse in
// the middle of a run ends the experiment before that run begins. After a new connection it says them within a second;
// one that has neither controller nor parameters never does.
asio::awaitable<void> Conduct::check_limits_of_robot() {
  const std::int64_t connected_for_us = parts_.driver.clock.utc_us() - robot().connected_at_us;
  const std::int64_t left_us =
      std::clamp<std::int64_t>(kSettingsWithin.count() - connected_for_us, 0, kSettingsWithin.count());
  const std::int64_t ends_us = parts_.driver.clock.steady_us() + left_us;
  const auto is_known = [this] {
    const auto* settings = parts_.driver.station.settings(experiment_.request.robot_id);
    return settings != nullptr && settings->is_controller_current && settings->parameters.is_current();
  };
  while (!abort_ && !is_known() && parts_.driver.clock.steady_us() < ends_us) {
    co_await changed_.wait_until(parts_.driver.clock, parts_.driver.clock.steady_us() + kLook.count());
  }
  auto find = [profile = profile_] { return demands_of(profile); };
  const Demands demands = co_await parts_.maths.run(std::move(find));
  const auto allowed = check_demands(demands, limits_of(parts_.driver.station.settings(experiment_.request.robot_id)));
  if (!allowed) abort({"robot_limits", allowed.error().detail});
}

asio::awaitable<void> Conduct::prepare(Variant variant) {
  co_await await_link();
  if (!abort_) co_await check_limits_of_robot();
  co_await await_actor();
  if (!abort_) take_control();
  if (!abort_) co_await await_fluid(variant.fluid);
  if (!abort_ && number_ == 1) co_await await_flow();  // one flow for the whole grid
  if (!abort_ && !variant.controller.empty()) co_await send_controller(variant.controller);
  if (!abort_ && variant.controller.empty()) co_await await_same_controller();
  if (!abort_) co_await await_model();
  if (!abort_) co_await go_to_start();
}

bool Conduct::is_actor_there() const { return life_.is_fresh(parts_.driver.clock.steady_us()); }

// SAFETY: nothing is prepared, and no control taken, for somebody who is not there; an unattended one goes on alone.
asio::awaitable<void> Conduct::await_actor() {
  const std::int64_t ends_us = parts_.driver.clock.steady_us() + kAbsence.count();
  while (!abort_ && !experiment_.request.is_unattended && !is_actor_there()) {
    if (parts_.driver.clock.steady_us() > ends_us) {
      abort({"nobody_present", fmt::format("{} gives no sign of life", experiment_.acts_for)});
    }
    co_await changed_.wait_until(parts_.driver.clock, parts_.driver.clock.steady_us() + kLook.count());
  }
}

// Paused by somebody while no driver is at work, or until the fluid is another one.
asio::awaitable<void> Conduct::await_resumption(microseconds limit) {
  const std::int64_t ends_us = parts_.driver.clock.steady_us() + limit.count();
  const bool was_paused = waiting_for_.has_value();
  while (!abort_ && waiting_for_ && !is_resumed_) {
    if (parts_.driver.clock.steady_us() > ends_us) abort({"paused_too_long", "nobody resumed it"});
    co_await changed_.wait_until(parts_.driver.clock, parts_.driver.clock.steady_us() + kLook.count());
  }
  if (is_in_hands()) boot_id_ = robot().boot_id;  // it may have been switched off meanwhile
  waiting_for_.reset();
  if (!abort_ && was_paused) co_await await_actor();
}

// SAFETY: just before the robot is moved.
void Conduct::check_robot() {
  if (abort_) return;
  if (robot().latched()) return abort({"emergency", "the robot is in emergency"});
  if (robot().link != station::LinkState::connected) return abort({"link_lost", "the link to the robot broke"});
  if (!is_at_rest(robot())) abort({"robot_not_at_rest", "the robot is not in manual at duty 0"});
}

// For the actor; an unattended one for as long as the robot may be alone.
void Conduct::take_control() {
  station::Station& station = parts_.driver.station;
  const station::RobotId& robot_id = experiment_.request.robot_id;
  const std::string holder = station.holder(robot_id);
  const bool is_its_own =
      holder == experiment_.acts_for && station.is_kept_by(robot_id, {experiment_.acts_for, experiment_.client});
  if (is_its_own && !experiment_.request.is_unattended) return;
  // SAFETY: what another page or program of the actor has taken meanwhile is not taken back.
  if (holder == experiment_.acts_for && !is_its_own && std::exchange(had_control_, true)) {
    return abort({"control_of_another", fmt::format("control is with another page or program of {}", holder)});
  }
  had_control_ = true;
  station::ControlRequest request;
  request.robot_id = robot_id;
  request.actor = experiment_.acts_for;
  request.client = experiment_.client;
  request.peer = peer();
  if (experiment_.request.is_unattended) request.lease = station::kLongestControl;
  const auto taken = station.control(request);
  if (!taken) abort({"control_of_another", taken.error().detail});
}

asio::awaitable<void> Conduct::await_fluid(std::string fluid) {
  if (!fluid.empty() && robot().fluid.empty()) {  // it says by it which one the robot is in, as a run does
    const station::Author by{experiment_.acts_for, peer(), parts_.driver.clock.utc_us()};
    auto named = parts_.driver.station.set_fluid(experiment_.request.robot_id, fluid, by);
    if (!named) {  // its lease may have run out just now
      co_await await_actor();
      if (!abort_) take_control();
      if (!abort_) named = parts_.driver.station.set_fluid(experiment_.request.robot_id, fluid, by);
    }
    if (!abort_ && !named) abort({"fluid", named.error().detail});
  }
  const std::int64_t ends_us = parts_.driver.clock.steady_us() + kFluidWithin.count();
  while (!abort_ && !fluid.empty() && !robot().fluid.empty() && robot().fluid != fluid) {
    is_resumed_ = false;  // SAFETY: who resumes it does so once the fluid is the right one
    waiting_for_ =
        Abort{"fluid", fmt::format("put the robot into '{}', say so, and resume; it is in '{}'", fluid, robot().fluid)};
    if (parts_.driver.clock.steady_us() > ends_us) abort(*waiting_for_);
    co_await changed_.wait_until(parts_.driver.clock, parts_.driver.clock.steady_us() + kLook.count());
  }
  if (abort_ || !waiting_for_) co_return;
  co_await await_resumption();
  if (!abort_) take_control();
}

// SAFETY: the station sets no pump, so nothing moves in a flow that nobody has confirmed; who resumes it confirms it.
asio::awaitable<void> Conduct::await_flow() {
  const auto last = co_await parts_.runs.last_flow(experiment_.request.robot_id);
  auto to_set = flow_to_set(profile_.conditions, last);
  if (abort_ || !to_set) co_return;
  is_resumed_ = false;
  waiting_for_ = Abort{"pump", std::move(*to_set)};
  co_await await_resumption(kFluidWithin);
  if (!abort_) take_control();
}

// SAFETY: where the grid names no controllers, all runs have the one of the first. A robot that was switched off while
// its fluid was changed may have forgotten it.
asio::awaitable<void> Conduct::await_same_controller() {
  if (number_ == 1) controller_checksum_ = robot().controller_checksum;
  const bool is_used = std::ranges::any_of(profile_.steps, is_closed_loop, &Step::kind);
  const std::int64_t ends_us = parts_.driver.clock.steady_us() + kFluidWithin.count();
  while (!abort_ && is_used && robot().controller_checksum != controller_checksum_) {
    is_resumed_ = false;
    waiting_for_ = Abort{kOtherController,
                         "the robot has another controller than in the first run, as after it was "
                         "switched off: send it that one again, and resume"};
    if (parts_.driver.clock.steady_us() > ends_us) abort(*waiting_for_);
    co_await changed_.wait_until(parts_.driver.clock, parts_.driver.clock.steady_us() + kLook.count());
  }
  if (abort_ || !waiting_for_) co_return;
  co_await await_resumption();
  if (!abort_) take_control();
}

// The parameters of a model are set at rest only.
asio::awaitable<void> Conduct::await_model() {
  const std::int64_t ends_us = parts_.driver.clock.steady_us() + kModelWithin.count();
  co_await parts_.driver.clock.sleep_for(kLook);  // it begins to be sent a little after the fluid was named
  while (!abort_ && robot().model.state == station::ModelState::sending) {
    if (parts_.driver.clock.steady_us() > ends_us) abort({"model", "the model of the fluid did not reach the robot"});
    co_await changed_.wait_until(parts_.driver.clock, parts_.driver.clock.steady_us() + kLook.count());
  }
}

asio::awaitable<std::uint64_t> Conduct::submit(const char* what, protocol::Command command, std::string arguments) {
  const std::int64_t ends_us = parts_.driver.clock.steady_us() + kCommandWithin.count();
  for (;;) {
    station::CommandRequest request;
    request.robot_id = experiment_.request.robot_id;
    request.action = command;
    request.arguments = arguments;
    request.actor = experiment_.acts_for;
    request.peer = peer();
    request.answer_grace = station::kOwnAnswerGrace;
    request.takes_control = false;
    request.until_verified = command.which_action == rheonaut_Command_set_controller_tag;
    const auto sent = co_await parts_.driver.station.submit(std::move(request));
    if (sent && was_accepted(sent->state) && (sent->reason.empty() || sent->state == station::CommandState::verified)) {
      co_return sent->effect_at_robot_us;
    }
    const bool may_pass =
        sent ? is_late(*sent) : sent.error().code == ErrorCode::unavailable || sent.error().reason == "not_connected";
    if (may_pass && !abort_ && parts_.driver.clock.steady_us() < ends_us) {
      co_await parts_.driver.clock.sleep_for(kLook);
      co_await await_link();
      if (!abort_) continue;
    }
    const std::string why = sent ? fmt::format("{} {}", text(sent->state), sent->reason) : sent.error().detail;
    abort({"command_refused", fmt::format("{}: {}", what, why)});
    co_return 0;
  }
}

asio::awaitable<void> Conduct::send_controller(std::string name) {
  std::int64_t ends_us = parts_.driver.clock.steady_us() + parts_.driver.back_within.count();
  auto controller = co_await parts_.controller_by_name(name, experiment_.request.robot_id);
  while (!abort_ && !controller &&
         controller.error().code == ErrorCode::unavailable) {  // that it is sent is noted first
    ends_us = co_await await_disk(ends_us, controller.error().detail);
    if (!abort_) controller = co_await parts_.controller_by_name(name, experiment_.request.robot_id);
  }
  if (abort_) co_return;  // SAFETY: what was decided meanwhile holds: nothing is sent any more
  if (!controller) {
    abort({"controller", fmt::format("controller '{}': {}", name, controller.error().detail)});
    co_return;
  }
  protocol::Command command = rheonaut_Command_init_zero;
  command.which_action = rheonaut_Command_set_controller_tag;
  command.action.set_controller = *controller;
  std::string arguments = json{{"name", name}}.dump();
  co_await submit("set_controller", command, std::move(arguments));
}

asio::awaitable<void> Conduct::go_to_start() {
  const bool goes_back = profile_.conditions.start == StartPosition::back && number_ > 1;
  if (goes_back) {
    TimeLine line = time_line_of(way_back(), {});
    const DriveEnd end = co_await drive(way_back(), std::move(line));
    if (end.abort) abort(*end.abort);
    co_return;
  }
  if (profile_.conditions.start == StartPosition::here) co_return;
  protocol::Command command = rheonaut_Command_init_zero;
  command.which_action = rheonaut_Command_zero_position_tag;
  std::string no_arguments = "{}";
  const std::uint64_t zeroed_at_us = co_await submit("zero_position", command, std::move(no_arguments));
  co_await await_samples_from(zeroed_at_us);
}

// Samples of before may still be on their way. A run begins behind them, so that one zero holds for all of it: else no
// position that was measured from outside could be placed in it.
asio::awaitable<void> Conduct::await_samples_from(std::uint64_t robot_us) {
  std::int64_t ends_us = parts_.driver.clock.steady_us() + kSamplesWithin.count();
  while (!abort_ && sampled_until_us_ < robot_us) {
    if (robot().link != station::LinkState::connected) {
      co_await await_link();
      ends_us = parts_.driver.clock.steady_us() + kSamplesWithin.count();
    }
    if (parts_.driver.clock.steady_us() > ends_us) abort({"missing_samples", "no sample of after the zero arrived"});
    co_await changed_.wait_until(parts_.driver.clock, parts_.driver.clock.steady_us() + kLook.count());
  }
}

}  // namespace server::experiments
