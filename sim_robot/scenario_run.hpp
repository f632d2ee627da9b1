// A scenario in virtual time: the robot in its world, its faults, and a station that follows the script.
//
// The same scenario and boot id give the same bytes; see docs/scenarios.md. An outage of the link is the end of the
// connection here, and a new one when it is over; other faults of link and robot are passed over.
#pragma once

#include <cstdint>
#include <vector>

#include "sim_robot/fault_timeline.hpp"
#include "sim_robot/scenario.hpp"
#include "sim_robot/station_peer.hpp"

namespace sim_robot {

class ScenarioRun {
 public:
  explicit ScenarioRun(const Scenario& scenario, FaultTimeline::Log log = {});

  void step();  // one tick
  // To the end; throws std::invalid_argument when the scenario has none.
  void run();

  double time_s() const { return static_cast<double>(robot_.robot_time_us()) * 1e-6; }
  const SimulatedRobot& robot() const { return robot_; }
  const StationPeer& station() const { return station_; }
  const FaultTimeline& faults() const { return faults_; }
  bool link_is_out() const;
  // Everything that the robot has sent so far, as it was on the wire.
  std::vector<std::uint8_t> bytes() const;

 private:
  struct Outage {
    double from_s, until_s;
  };

  void follow_link();
  void follow_script();
  void say(const ScriptStep& step);
  void renew_duty();

  const Scenario scenario_;
  std::vector<Outage> outages_;
  SimulatedRobot robot_;
  StationPeer station_;
  FaultTimeline faults_;
  bool is_connected_ = false;
  std::size_t next_step_ = 0;  // of the script
  float duty_ = 0;
  double duty_until_s_ = 0;  // while a lease is renewed
  int ticks_to_renewal_ = 0;
};

}  // namespace sim_robot
