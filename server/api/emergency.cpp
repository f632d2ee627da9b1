// Says how long each stop waits for its answer.
#include "server/api/emergency.hpp"

#include <utility>

namespace server {
namespace asio = boost::asio;

asio::awaitable<Result<CommandRecord>> stop_robot(Station& station, StopRequest request) {
  const RobotState* robot = station.find(request.robot_id);
  const bool connected = robot != nullptr && robot->link == LinkState::connected;
  const microseconds patience = connected ? kStopPatience : microseconds{0};
  co_return co_await station.emergency_stop(std::move(request), patience);
}

asio::awaitable<StopsOfAll> stop_all_robots(Station& station, StopRequest request) {
  return station.stop_all(std::move(request), kStopPatience);
}

}  // namespace server
