// The faults in force, and those still to come.
//
// A scenario's faults come by true time since the run began, others by inject() at once. Each holds for its for_s; then
// its target is as it was when robot and link were made. One that follows on the same target replaces it, and a reboot
// ends a block. A fault that is impossible in this run is logged and skipped. The same in virtual and in real time.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "sim_robot/robot/robot_life.hpp"
#include "sim_robot/scenario/scenario.hpp"
#include "sim_robot/world/microseconds.hpp"

namespace sim_robot {

struct FaultInForce {
  std::uint64_t id = 0;
  Fault fault;
  std::uint64_t since_us = 0, until_us = 0;
};

class FaultTimeline {
 public:
  static constexpr std::uint64_t kNever = kNeverUs;
  using Log = std::function<void(const std::string& line)>;

  // The faults by time. `log` gets a line when a fault begins or ends; it may be empty.
  explicit FaultTimeline(std::vector<TimedFault> faults = {}, Log log = {});

  // As RobotLife::advance_to(), with due faults applied between the ticks.
  void advance(const FaultyRobot& robot, std::uint64_t true_us);

  // Returns the fault's id; momentary faults have one too, but are never in force. Throws as apply().
  std::uint64_t inject(const Fault& fault, const FaultyRobot& robot);
  // Ends a fault before its time. False when no fault in force has this id.
  bool withdraw(std::uint64_t id, const FaultyRobot& robot);

  const std::vector<FaultInForce>& in_force() const { return in_force_; }
  std::size_t passed_over() const { return passed_over_; }
  std::size_t to_come() const { return to_come_.size() - next_; }

 private:
  std::uint64_t next_us() const;  // when something is due, or kNever
  std::uint64_t next_end_us() const;
  std::uint64_t next_start_us() const;
  void apply_until(const FaultyRobot& robot, std::uint64_t now_us);
  void end_due(const FaultyRobot& robot, std::uint64_t at_us);
  std::uint64_t begin(const Fault& fault, const FaultyRobot& robot, std::uint64_t at_us);
  void end_replaced(const Fault& next, const FaultyRobot& robot);
  void say(std::uint64_t at_us, const std::string& what) const;

  std::vector<TimedFault> to_come_;  // by time
  std::size_t next_ = 0;             // of to_come_
  std::vector<FaultInForce> in_force_;
  std::uint64_t now_us_ = 0;
  std::uint64_t last_id_ = 0;
  std::size_t passed_over_ = 0;
  Log log_;
};

}  // namespace sim_robot
