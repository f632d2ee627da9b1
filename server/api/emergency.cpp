// Hands stops to the station and gathers the answers.
#include "server/api/emergency.hpp"

#include <memory>

#include "server/api/contained.hpp"

namespace server {
namespace asio = boost::asio;

namespace {

// Shared by the asker and the stops: either may end first.
struct Gathering {
  explicit Gathering(asio::io_context& loop) : all_ended{loop} {}
  Signal all_ended;
  std::size_t waiting = 0;
  StopsOfAll stops;
};

// Counts one stop down, however it ends.
class Awaited {
 public:
  Awaited(std::shared_ptr<Gathering> gathering, RobotId robot_id)
      : gathering_{std::move(gathering)}, robot_id_{std::move(robot_id)} {}
  ~Awaited() {
    if (!taken_) gathering_->stops.failed.push_back(robot_id_);
    if (--gathering_->waiting == 0) gathering_->all_ended.notify();
  }
  Awaited(const Awaited&) = delete;
  Awaited& operator=(const Awaited&) = delete;

  void take(CommandRecord record) {
    gathering_->stops.records.push_back(std::move(record));
    taken_ = true;
  }

 private:
  std::shared_ptr<Gathering> gathering_;
  RobotId robot_id_;
  bool taken_ = false;
};

asio::awaitable<void> stop_one(Station& station, StopRequest request, std::shared_ptr<Gathering> gathering) {
  Awaited awaited{std::move(gathering), request.robot_id};
  auto record = co_await stop_robot(station, std::move(request));
  if (record) awaited.take(std::move(*record));
}

}  // namespace

asio::awaitable<Result<CommandRecord>> stop_robot(Station& station, StopRequest request) {
  const RobotState* robot = station.find(request.robot_id);
  const bool connected = robot != nullptr && robot->link == LinkState::connected;
  const microseconds patience = connected ? kStopPatience : microseconds{0};
  co_return co_await station.emergency_stop(std::move(request), patience);
}

asio::awaitable<StopsOfAll> stop_all_robots(asio::io_context& loop, TaskGroup& tasks, Station& station,
                                            StopRequest request) {
  const auto gathering = std::make_shared<Gathering>(loop);
  std::vector<RobotId> ids;
  for (const auto& [id, robot] : station.robots()) ids.push_back(id);
  gathering->waiting = ids.size();
  for (const RobotId& id : ids) {
    request.robot_id = id;
    const std::string name = "emergency stop of " + id;
    tasks.spawn(name, contained(name, stop_one(station, request, gathering)));
  }
  if (!ids.empty()) co_await gathering->all_ended.wait();
  co_return gathering->stops;
}

}  // namespace server
