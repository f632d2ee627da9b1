// Brings a robot to rest in manual, and ends only when it is there, or when nobody here can do more; and keeps the list
// of the robots that are owed that in nobody's name.
//
// SAFETY: a set_mode manual goes out again and again until the robot's telemetry shows that it is at rest: it stops
// the motor and drops every command that waits on the robot. A robot that does not obey is stopped by an emergency
// stop, which is kept for one that is not there. Loop thread; all that it is given outlives it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <map>
#include <string>
#include <vector>

#include "server/experiments/runner/stubborn_writer.hpp"
#include "server/runtime/clock.hpp"
#include "server/runtime/tasks.hpp"
#include "server/station/station.hpp"
#include "server/storage/experiments/experiment_store.hpp"

namespace server::experiments {

enum class Rest : std::uint8_t {
  at_rest,
  latched,     // in emergency: the motor is off
  of_another,  // somebody else controls the robot now, and is responsible for it
  stopped,     // it did not obey: an emergency stop was sent, or is kept
  away,        // the link broke, and the caller tries again when it is back
};

inline constexpr const char* kStationActor = "station:experiments";  // in the name of nobody else
inline constexpr microseconds kRestLimit{40'000'000};  // a robot without a link is at rest after 30 s, or never

// In manual at duty 0, as its telemetry shows.
bool is_at_rest(const station::RobotState& robot);

struct RestRequest {
  station::RobotId robot_id;
  std::string actor;  // in whose name
  std::string peer;   // "experiment:7"
  bool ends_with_link = false;
};
boost::asio::awaitable<Rest> bring_to_rest(station::Station& station, runtime::Clock& clock, RestRequest request);

// The robots that are owed rest: of an experiment that a restart interrupted, or moving in a name whose right ended.
//
// SAFETY: each is on disk until it was seen at rest, has booted, or is somebody else's to control; one that is away is
// brought to rest when it is back, first of all but a stop, also after a restart of the station. It receives the
// reports of the station from now on.
class RestsOwed final : public station::StationSink {
 public:
  RestsOwed(runtime::Clock& clock, runtime::TaskGroup& tasks, station::Station& station, StubbornWriter& writer);

  void load(const std::vector<storage::OwedRest>& owed);  // of an earlier start

  void on_rest_owed(const station::RobotState& robot, const runtime::EndedRight& right) override;
  void on_robot(const station::RobotState& robot) override;

 private:
  struct Owed {
    station::BootId boot_id = 0;  // 0: whichever
    int times = 1;                // that it was owed
    bool is_at_work = false;
  };

  void look_at(const station::RobotState& robot);
  void spawn(const station::RobotId& robot_id, boost::asio::awaitable<void> task);
  boost::asio::awaitable<void> settle(station::RobotId robot_id);
  boost::asio::awaitable<void> keep(storage::OwedRest owed);
  boost::asio::awaitable<void> forget(station::RobotId robot_id);

  runtime::Clock& clock_;
  runtime::TaskGroup& tasks_;
  station::Station& station_;
  StubbornWriter& writer_;
  std::map<station::RobotId, Owed> owed_;
};

}  // namespace server::experiments
