// Faults by time line in virtual time: how each is made, and a robot in auto that they come to.
#pragma once

#include <vector>

#include "tests/sim_robot/link_story.hpp"

namespace sim_robot {

inline Fault fault_of(FaultKind kind, double for_s = kForEver) {
  Fault fault;
  fault.kind = kind;
  fault.for_s = for_s;
  return fault;
}

inline Fault outage(double for_s, bool then_reset = false) {
  Fault fault = fault_of(FaultKind::link_outage, for_s);
  fault.then_reset = then_reset;
  return fault;
}

inline Fault half_open(Direction direction, double for_s = kForEver) {
  Fault fault = fault_of(FaultKind::link_half_open, for_s);
  fault.direction = direction;
  return fault;
}

inline Fault delay(double delay_s, Direction direction, double for_s = kForEver) {
  Fault fault = fault_of(FaultKind::link_delay, for_s);
  fault.delay_s = delay_s;
  fault.direction = direction;
  return fault;
}

inline Fault throttle(double bytes_per_s, double for_s = kForEver) {
  Fault fault = fault_of(FaultKind::link_throttle, for_s);
  fault.bytes_per_s = bytes_per_s;
  return fault;
}

inline Fault reboot(protocol::ResetCause cause, double off_for_s) {
  Fault fault = fault_of(FaultKind::reboot);
  fault.cause = cause;
  fault.off_for_s = off_for_s;
  return fault;
}

// In auto, on its way, from 1 s on; the faults come later.
class FaultEffects : public LinkStory {
 protected:
  void begin_in_auto(std::vector<TimedFault> timed, const LinkOptions& options = {}) {
    faults = FaultTimeline{std::move(timed)};
    begin(options);
    run_to(1);
    ASSERT_TRUE(reached_auto(0.5F));
  }
  std::uint64_t inject(const Fault& fault) { return faults.inject(fault, faulty()); }
  // The link has connected at least this often since the beginning, and the station has every sample.
  bool is_back(int connections = 1) {
    return run_until([&] { return link->connections() >= connections && caught_up(); }, 10);
  }
  double age_of_newest_s() const {
    return now_s() - 1e-6 * static_cast<double>(station->samples.rbegin()->second.robot_time_us);
  }
};

}  // namespace sim_robot
