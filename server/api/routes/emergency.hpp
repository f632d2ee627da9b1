// Emergency stops on behalf of people: one robot, or all of them at once.
#pragma once

#include <nlohmann/json.hpp>

#include "server/station/station.hpp"

namespace server::api {

// How long a stop waits for the robot's answer before the answer says that it is kept.
inline constexpr microseconds kStopPatience{1'500'000};

// A robot that is not connected cannot answer: its stop is kept, and the answer says so at once.
boost::asio::awaitable<Result<station::CommandRecord>> stop_robot(station::Station& station,
                                                                  station::StopRequest request);

boost::asio::awaitable<station::StopsOfAll> stop_all_robots(station::Station& station, station::StopRequest request);

// What became of the stop of all, as StopSummary in openapi.yaml: how many robots of each outcome, and the names of
// those that did not acknowledge, the connected ones first. At most kMaxNamedRobots names, however many robots there
// are.
inline constexpr std::size_t kMaxNamedRobots = 100;
nlohmann::ordered_json stop_summary(const station::Station& station, const station::StopsOfAll& stops);

}  // namespace server::api
