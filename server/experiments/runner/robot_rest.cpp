#include "server/experiments/runner/robot_rest.hpp"

#include <spdlog/spdlog.h>

#include <boost/asio/post.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <chrono>
#include <optional>
#include <utility>

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
    // SAFETY: not even when the order was accepted: somebody else moves it by now.
    const std::string holder = station.holder(request.robot_id);
    if (!holder.empty() && holder != request.actor) co_return Rest::of_another;
    if (request.ends_with_link && robot->link != station::LinkState::connected) co_return Rest::away;
    // Telemetry of after the order: before it a schedule at duty 0 would look like rest.
    const bool is_shown = ordered_at_robot_us != 0 && robot->latest_robot_time_us > ordered_at_robot_us;
    if (is_shown && is_at_rest(*robot)) co_return Rest::at_rest;
    if (robot->link == station::LinkState::connected) {
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

RestsOwed::RestsOwed(runtime::Clock& clock, runtime::TaskGroup& tasks, station::Station& station,
                     StubbornWriter& writer)
    : clock_{clock}, tasks_{tasks}, station_{station}, writer_{writer} {
  station.add_sink(*this);
}

// An exception ends its task alone.
void RestsOwed::spawn(const station::RobotId& robot_id, asio::awaitable<void> task) {
  const std::string name = "rest of robot '" + robot_id + "'";
  tasks_.spawn(name,
               runtime::contained(tasks_.exceptions(), clock_, runtime::Ended::experiment, name, std::move(task)));
}

void RestsOwed::load(const std::vector<storage::OwedRest>& owed) {
  for (const storage::OwedRest& rest : owed) {
    owed_.try_emplace(rest.robot_id, Owed{rest.boot_id});
    if (const station::RobotState* robot = station_.find(rest.robot_id)) look_at(*robot);
  }
}

void RestsOwed::on_rest_owed(const station::RobotState& robot, const runtime::EndedRight& right) {
  spdlog::warn("robot '{}' is brought to rest: {}", robot.id, right.why);
  Owed& owed = owed_[robot.id];
  owed.boot_id = robot.boot_id;
  ++owed.times;
  spawn(robot.id, keep({robot.id, robot.boot_id, right.why}));
  look_at(robot);
}

void RestsOwed::on_robot(const station::RobotState& robot) { look_at(robot); }

// SAFETY: the robot of an experiment that a restart interrupted goes on in auto, if its link held; nobody watches it.
void RestsOwed::look_at(const station::RobotState& robot) {
  const auto found = owed_.find(robot.id);
  if (found == owed_.end() || found->second.is_at_work) return;
  const Owed& owed = found->second;
  const bool is_of_another = !station_.holder(robot.id).empty();  // a report may show one whose lease has run out
  const bool has_booted = owed.boot_id != 0 && robot.boot_id != owed.boot_id;
  if (is_of_another || has_booted || robot.latched()) {
    owed_.erase(found);
    return spawn(robot.id, forget(robot.id));
  }
  if (robot.link != station::LinkState::connected) return;
  found->second.is_at_work = true;
  spawn(robot.id, settle(robot.id));
}

asio::awaitable<void> RestsOwed::settle(station::RobotId robot_id) {
  Owed& owed = owed_.at(robot_id);  // nobody else takes it out while it is at work
  struct AtWork {
    bool& is_at_work;
    ~AtWork() { is_at_work = false; }
  };
  std::optional<AtWork> at_work{owed.is_at_work};
  co_await asio::post(asio::use_awaitable);  // a sink never calls the station from inside
  for (int times = 0; times != owed.times;) {
    times = owed.times;
    RestRequest request{robot_id, kStationActor, "experiment:interrupted", true};
    const Rest rest = co_await bring_to_rest(station_, clock_, std::move(request));
    if (rest == Rest::away) co_return;
  }
  at_work.reset();
  owed_.erase(robot_id);
  co_await forget(robot_id);
}

asio::awaitable<void> RestsOwed::keep(storage::OwedRest owed) {
  auto owe = [owed, utc_us = clock_.utc_us()](storage::Database& database) {
    storage::owe_rest(database, owed, utc_us);
  };
  co_await writer_.keep("the rest that a robot is owed", std::move(owe));
}

asio::awaitable<void> RestsOwed::forget(station::RobotId robot_id) {
  auto seen = [robot_id](storage::Database& database) { storage::note_rest(database, robot_id); };
  co_await writer_.keep("the rest of a robot", std::move(seen));
}

}  // namespace server::experiments
