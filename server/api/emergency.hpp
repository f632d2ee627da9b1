// Emergency stops on behalf of people: one robot, or all of them at once.
#pragma once

#include "server/station/station.hpp"

namespace server {

// How long a stop waits for the robot's answer before the asker is told that it is kept.
inline constexpr microseconds kStopPatience{1'500'000};

// A robot that is not connected cannot answer: its stop is kept and the asker is told at once.
boost::asio::awaitable<Result<CommandRecord>> stop_robot(Station& station, StopRequest request);

boost::asio::awaitable<StopsOfAll> stop_all_robots(Station& station, StopRequest request);

}  // namespace server
