// The parameters, the controller and the clock that one robot has reported, and their changes to record.
//
// A robot reports parameters and controller after each Welcome, and each change of them. Publishes nothing: each
// function returns what the caller publishes. Loop thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <set>

#include "server/station/state/clock_sync.hpp"
#include "server/station/state/in_force.hpp"
#include "server/station/state/station_state.hpp"

namespace server::station {

// When a report came, in the terms of what is recorded.
struct ReportMoment {
  BootId boot_id = 0;
  std::uint64_t first_seq = 0;  // the first sample that is made after it
  std::int64_t utc_us = 0;
};

// Samples that were made before the report may still be on their way: they are counted on, in periods.
// `next_sample_at_robot_us`: when the robot makes its sample robot.next_seq.
ReportMoment moment_of_report(const RobotState& robot, std::uint64_t next_sample_at_robot_us, std::int64_t utc_us);

class ReportedConfiguration {
 public:
  struct ClockReport {
    ClockEstimate estimate;
    std::int64_t station_step_us = 0;   // the station's UTC was set by so much; 0: it was not
    std::optional<ClockRecord> record;  // none: nothing to be recorded
  };

  void begin_connection();
  void begin_boot();

  const RobotSettings& settings() const { return settings_; }

  // Takes a page of parameters; a record when the table is whole and has changed.
  std::optional<InForceRecord> add(const protocol::ParameterPage& page, const ReportMoment& moment);
  // `former`: what restore_controller brings back now; none: not known.
  InForceRecord add(const protocol::Controller& controller, const std::optional<protocol::Controller>& former,
                    const ReportMoment& moment);

  // Takes an exchange of times. It is recorded once a minute, when the estimate has moved by more than either says it
  // may be wrong, and when the station's own UTC was set. The estimate itself is against steady time, which nobody
  // sets.
  ClockReport add(const ClockExchange& exchange, const RobotState& robot, std::int64_t utc_minus_steady_us);

 private:
  InForceRecord record(InForceContent content, const ReportMoment& moment);

  RobotSettings settings_;
  std::set<std::size_t> reported_kinds_;  // in this connection, as index() of the content
  ClockSync clock_sync_;                  // of the boot that is, or was last, connected
  ClockRecord clock_recorded_;            // the latest of that boot; boot_id 0: none yet
  std::int64_t utc_minus_steady_us_ = 0;  // at its latest exchange
};

}  // namespace server::station
