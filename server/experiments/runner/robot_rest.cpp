#include "server/experiments/runner/robot_rest.hpp"

#include <chrono>

namespace server::experiments {
namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

constexpr microseconds kTry = 200ms;
constexpr microseconds kObeysWithin = 3s;  // while it is connected

station::CommandRequest to_manual(const RestRequest& request) {
  station::CommandRequest command;
  command.robot_id = request.robot_id;
  command.action.which_action = rheonaut_Command_set_mode_tag;
  command.action.action.set_mode.mode = rheonaut_MODE_MANUAL;
  command.arguments = R"({"mode":"manual"})";
  command.actor = request.actor;
  command.peer = request.peer;
  command.time_to_live = 1s;
  command.answer_grace = station::kOwnAnswerGrace;
  command.takes_control = false;
  return command;
}

}  // namespace

bool is_at_rest(const station::RobotState& robot) {
  return robot.context.mode == rheonaut_MODE_MANUAL && robot.sample && robot.sample->duty == 0;
}

asio::awaitable<Rest> bring_to_rest(station::Station& station, runtime::Clock& clock, RestRequest request) {
  const std::int64_t ends_us = clock.steady_us() + kRestLimit.count();
  std::int64_t connected_for_us = 0;
  std::uint64_t ordered_at_robot_us = 0;  // 0: it has not been accepted yet
  for (std::int64_t now_us = clock.steady_us(); now_us < ends_us; now_us = clock.steady_us()) {
    const station::RobotState* robot = station.find(request.robot_id);
    if (robot == nullptr || robot->latched()) co_return Rest::latched;
    // Telemetry of after the order: before it a schedule at duty 0 would look like rest.
    const bool is_shown = ordered_at_robot_us != 0 && robot->latest_robot_time_us > ordered_at_robot_us;
    if (is_shown && is_at_rest(*robot)) co_return Rest::at_rest;
    if (robot->link == station::LinkState::connected && !is_shown) {
      auto command = to_manual(request);
      const auto sent = co_await station.submit(std::move(command));
      if (!sent && sent.error().reason == "not_in_control") co_return Rest::of_another;
      // SAFETY: a reservation keeps an actor from commanding, and no robot from being brought to rest. Its holder, once
      // in control, is responsible: the station's command is refused then.
      if (!sent && sent.error().reason == "reserved") request.actor = kStationActor;
      if (sent && was_accepted(sent->state)) ordered_at_robot_us = sent->effect_at_robot_us;
    }
    co_await clock.sleep_for(kTry);
    const station::RobotState* after = station.find(request.robot_id);
    const bool is_connected = after != nullptr && after->link == station::LinkState::connected;
    connected_for_us = is_connected ? connected_for_us + clock.steady_us() - now_us : 0;
    if (connected_for_us > kObeysWithin.count()) break;
  }
  // SAFETY: it did not obey, or nobody knows where it is.
  station::StopRequest stop{request.robot_id, request.actor, request.peer, "", 0};
  co_await station.emergency_stop(std::move(stop), 1s);
  co_return Rest::stopped;
}

}  // namespace server::experiments
