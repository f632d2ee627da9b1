// Emergency stops on behalf of people: one robot, or all of them at once.
#pragma once

#include <string>
#include <vector>

#include "server/station/station.hpp"
#include "server/tasks.hpp"

namespace server {

// How long a stop waits for the robot's answer before the asker is told that it is kept.
inline constexpr microseconds kStopPatience{1'500'000};

// A robot that is not connected cannot answer: its stop is kept and the asker is told at once.
boost::asio::awaitable<Result<CommandRecord>> stop_robot(Station& station, StopRequest request);

struct StopsOfAll {
  std::vector<CommandRecord> records;
  std::vector<RobotId> failed;  // the station could not take their stop; its log says why
};

// SAFETY: every robot's stop is on its way before the answer of any is waited for, and none that fails keeps the others
// or the asker waiting. The request's robot_id is not looked at.
boost::asio::awaitable<StopsOfAll> stop_all_robots(boost::asio::io_context& loop, TaskGroup& tasks, Station& station,
                                                   StopRequest request);

}  // namespace server
