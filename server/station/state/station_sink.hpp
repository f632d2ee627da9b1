// The interface of the station's observers: the recorder, the live feed, the runs.
//
// Called on the loop's thread. A sink returns at once, copies what it keeps, and never calls the station from inside.
#pragma once

#include "server/runtime/ended_right.hpp"
#include "server/station/state/audit_note.hpp"
#include "server/station/state/station_state.hpp"

namespace server::station {

class StationSink {
 public:
  virtual ~StationSink() = default;

  // The robot's state changed otherwise than by samples: connected, lost, status, durable, clock.
  virtual void on_robot(const RobotState&) {}
  virtual void on_fluid(const RobotState&) {}  // robot.fluid was named
  virtual void on_samples(const RobotState&, const SampleBatch&) {}
  // Samples, or an event, that came and cannot be recorded: they are lost for good.
  virtual void on_unusable_samples(const RobotState&, std::uint64_t first_seq, std::uint64_t next_seq) {
    static_cast<void>(first_seq), static_cast<void>(next_seq);
  }
  virtual void on_unusable_event(const RobotState&, std::uint64_t event_seq) { static_cast<void>(event_seq); }
  // An event that came and is not recorded, since the robot has sent too many.
  virtual void on_event_left_out(const RobotState&, std::uint64_t event_seq) { static_cast<void>(event_seq); }
  virtual void on_event(const RobotState&, const RobotEvent&) {}
  virtual void on_command(const CommandRecord&) {}
  // An emergency stop was asked for whose answer is one that is under way or in force: there is no new command.
  virtual void on_stop_again(const CommandRecord& in_force) { static_cast<void>(in_force); }
  virtual void on_audit(const AuditNote&) {}
  // Somebody's right to command has ended: whatever acts in their name ends.
  virtual void on_right_ended(const runtime::EndedRight&) {}
  // The robot moves, or may, in a name whose right to command has ended: it is to be brought to rest in nobody's.
  virtual void on_rest_owed(const RobotState&, const runtime::EndedRight&) {}
  virtual void on_clock(const RobotState&, const ClockRecord&) {}
  virtual void on_in_force(const RobotState&, const InForceRecord&) {}

  // Whether somebody waits for what the robot sends; if nobody does, it may be read some 30 ms later.
  virtual bool watches(const RobotId&) const { return false; }
};

}  // namespace server::station
