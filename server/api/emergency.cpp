// Hands stops to the station and gathers the answers.
#include "server/api/emergency.hpp"

namespace server {
namespace asio = boost::asio;

namespace {

// Shared by the asker and the stops: either may end first.
struct Gathering {
  explicit Gathering(asio::io_context& loop) : all_ended{loop} {}
  Signal all_ended;
  std::size_t waiting = 0;
  std::vector<CommandRecord> records;
};

asio::awaitable<void> stop_one(Station& station, RobotId robot_id, std::string actor,
                               std::shared_ptr<Gathering> gathering) {
  auto record = co_await stop_robot(station, std::move(robot_id), std::move(actor));
  if (record) gathering->records.push_back(std::move(*record));
  if (--gathering->waiting == 0) gathering->all_ended.notify();
}

}  // namespace

asio::awaitable<Result<CommandRecord>> stop_robot(Station& station, RobotId robot_id, std::string actor) {
  const RobotState* robot = station.find(robot_id);
  const bool connected = robot != nullptr && robot->link == LinkState::connected;
  const microseconds patience = connected ? kStopPatience : microseconds{0};
  co_return co_await station.emergency_stop(std::move(robot_id), std::move(actor), patience);
}

asio::awaitable<std::vector<CommandRecord>> stop_all_robots(asio::io_context& loop, TaskGroup& tasks, Station& station,
                                                            std::string actor) {
  const auto gathering = std::make_shared<Gathering>(loop);
  std::vector<RobotId> ids;
  for (const auto& [id, robot] : station.robots()) ids.push_back(id);
  gathering->waiting = ids.size();
  for (const RobotId& id : ids) tasks.spawn("emergency stop of " + id, stop_one(station, id, actor, gathering));
  if (!ids.empty()) co_await gathering->all_ended.wait();
  co_return gathering->records;
}

}  // namespace server
