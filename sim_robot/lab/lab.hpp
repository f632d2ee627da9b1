// A robot over its boots, a bad network, a minimal station and a time line of faults, stepped together in virtual time.
#pragma once

#include <utility>
#include <vector>

#include "sim_robot/lab/linked_peer.hpp"
#include "sim_robot/scenario/fault_timeline.hpp"

namespace sim_robot {

class Lab {
 public:
  explicit Lab(SimulatedRobotConfig config, const LinkOptions& options = {}, std::vector<TimedFault> timed = {},
               FaultTimeline::Log log = {})
      : robot(std::move(config)), link(robot, options), station(link), faults(std::move(timed), std::move(log)) {}
  Lab(const Lab&) = delete;
  Lab& operator=(const Lab&) = delete;

  // One step: the faults that begin now, the due tick, then 10 ms of network and station.
  void step() {
    link.exchange();  // what the station has sent since arrives before the tick
    faults.advance(faulty(), next_us_);
    link.exchange();
    station.serve();
    next_us_ += ImpairedLink::kStepUs;
  }
  FaultyRobot faulty() { return {robot, &link}; }

  double time_s() const { return 1e-6 * static_cast<double>(next_us_); }  // true time of the next step; the first is 0
  const robot_fw::Robot& core() const { return robot.core(); }

  RobotLife robot;
  ImpairedLink link;
  LinkedPeer station;
  FaultTimeline faults;

 private:
  std::uint64_t next_us_ = 0;
};

}  // namespace sim_robot
