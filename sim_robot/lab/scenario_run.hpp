// A scenario in virtual time: the robot in its world and over its boots, its network, its faults, and a station that
// follows the script.
//
// The same scenario and boot id give the same bytes; see docs/scenarios.md. The network is perfect until a fault makes
// it bad. Commands of the script wait while the station knows that there is no link; a command sent over a link that
// has just died is lost.
#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "sim_robot/lab/lab.hpp"
#include "sim_robot/scenario/scenario.hpp"

namespace sim_robot {

class ScenarioRun {
 public:
  explicit ScenarioRun(const Scenario& scenario, FaultTimeline::Log log = {});

  void step();  // one tick
  // Runs to the end; throws std::invalid_argument when the scenario has none.
  void run();

  double time_s() const { return lab_.time_s(); }  // true time of the next tick
  const RobotLife& life() const { return lab_.robot; }
  const SimulatedRobot& robot() const { return lab_.robot.robot(); }
  const LinkedPeer& station() const { return lab_.station; }
  const FaultTimeline& faults() const { return lab_.faults; }
  // The robot's true position at a sample, relative to its start; boots count from 1.
  double true_position_m(std::size_t boot, std::uint64_t robot_time_us) const;
  // Every frame of the robot that has arrived so far, as bytes of the wire.
  std::vector<std::uint8_t> bytes() const;

 private:
  void follow_script();
  void say(const ScriptStep& step);
  std::uint64_t emergency_id() const;
  void renew_duty();

  const Scenario scenario_;
  Lab lab_;
  std::map<std::pair<std::size_t, std::uint64_t>, double> true_position_m_;  // by boot and robot time, at each step
  std::size_t next_step_ = 0;                                                // of the script
  float duty_ = 0;
  double duty_until_s_ = 0;  // while a lease is renewed
  int ticks_to_renewal_ = 0;
};

}  // namespace sim_robot
