// Says how long each stop waits for its answer.
#include "server/api/routes/emergency.hpp"

#include <array>
#include <map>
#include <utility>
#include <vector>

namespace server::api {
namespace asio = boost::asio;

asio::awaitable<Result<station::CommandRecord>> stop_robot(station::Station& station, station::StopRequest request) {
  const station::RobotState* robot = station.find(request.robot_id);
  const bool connected = robot != nullptr && robot->link == station::LinkState::connected;
  const microseconds patience = connected ? kStopPatience : microseconds{0};
  co_return co_await station.emergency_stop(std::move(request), patience);
}

asio::awaitable<station::StopsOfAll> stop_all_robots(station::Station& station, station::StopRequest request) {
  return station.stop_all(std::move(request), kStopPatience);
}

nlohmann::ordered_json stop_summary(const station::Station& station, const station::StopsOfAll& stops) {
  std::size_t acknowledged = 0;
  std::vector<station::RobotId> unanswered, kept;
  for (const station::CommandRecord& record : stops.records) {
    const station::RobotState* robot = station.find(record.robot_id);
    const bool connected = robot != nullptr && robot->link == station::LinkState::connected;
    if (was_accepted(record.state)) {
      ++acknowledged;
    } else {
      (connected ? unanswered : kept).push_back(record.robot_id);
    }
  }
  nlohmann::ordered_json out;
  out["robots"] = stops.records.size() + stops.failed.size() + stops.left_out.size();
  out["acknowledged"] = acknowledged;
  out["unanswered"] = unanswered.size();
  out["failed"] = stops.failed.size();
  out["kept"] = kept.size();
  out["left_out"] = stops.left_out.size();
  out["not_acknowledged"] = nlohmann::ordered_json::array();
  const std::array<std::pair<const char*, const std::vector<station::RobotId>*>, 3> named{
      {{"failed", &stops.failed}, {"unanswered", &unanswered}, {"kept", &kept}}};
  std::size_t not_named = 0;
  for (const auto& [outcome, robots] : named) {
    for (const station::RobotId& id : *robots) {
      if (out["not_acknowledged"].size() == kMaxNamedRobots) {
        ++not_named;
      } else {
        out["not_acknowledged"].push_back({{"robot_id", id}, {"outcome", outcome}});
      }
    }
  }
  out["not_named"] = not_named;
  return out;
}

}  // namespace server::api
