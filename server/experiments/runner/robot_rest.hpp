// Brings a robot to rest in manual, and ends only when it is there, or when nobody here can do more.
//
// SAFETY: a set_mode manual goes out again and again until the robot's telemetry shows that it is at rest: it stops
// the motor and drops every command that waits on the robot. A robot that does not obey is stopped by an emergency
// stop, which is kept for one that is not there. Loop thread; all that it is given outlives it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <string>

#include "server/runtime/clock.hpp"
#include "server/station/station.hpp"

namespace server::experiments {

enum class Rest : std::uint8_t {
  at_rest,
  latched,     // in emergency: the motor is off
  of_another,  // somebody else controls the robot now, and is responsible for it
  stopped,     // it did not obey: an emergency stop was sent, or is kept
};

inline constexpr const char* kStationActor = "station:experiments";  // in the name of nobody else
inline constexpr microseconds kRestLimit{40'000'000};  // a robot without a link is at rest after 30 s, or never

// In manual at duty 0, as its telemetry shows.
bool is_at_rest(const station::RobotState& robot);

struct RestRequest {
  station::RobotId robot_id;
  std::string actor;  // in whose name
  std::string peer;   // "experiment:7"
};
boost::asio::awaitable<Rest> bring_to_rest(station::Station& station, runtime::Clock& clock, RestRequest request);

}  // namespace server::experiments
