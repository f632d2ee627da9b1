// A robot over its boots, a bad network, the least of a station, and faults by time: stepped together, in virtual time.
#pragma once

#include <utility>
#include <vector>

#include "sim_robot/fault_timeline.hpp"
#include "sim_robot/linked_peer.hpp"

namespace sim_robot {

class Lab {
 public:
  explicit Lab(SimulatedRobotConfig config, const LinkOptions& options = {}, std::vector<TimedFault> timed = {},
               FaultTimeline::Log log = {})
      : robot(std::move(config)), link(robot, options), station(link), faults(std::move(timed), std::move(log)) {}
  Lab(const Lab&) = delete;
  Lab& operator=(const Lab&) = delete;

  // 10 ms: what is due of the faults, then robot, network and station.
  void step() {
    faults.apply_due(robot.robot());
    station.step();
  }

  double time_s() const { return 1e-6 * static_cast<double>(robot.true_us()); }  // true time
  const robot_fw::Robot& core() const { return robot.core(); }

  RobotLife robot;
  ImpairedLink link;
  LinkedPeer station;
  FaultTimeline faults;
};

}  // namespace sim_robot
