#include "server/station/reported_configuration.hpp"

#include <algorithm>
#include <cstdlib>
#include <utility>

namespace server::station {
namespace {

constexpr std::int64_t kClockRecordPeriodUs = 60'000'000;
constexpr std::int64_t kStationStepUs = 50'000;  // within a second; what NTP slews is far below

}  // namespace

ReportMoment moment_of_report(const RobotState& robot, std::uint64_t next_sample_at_robot_us, std::int64_t utc_us) {
  const std::uint32_t live_period_us = robot.context.period_us;
  const std::uint64_t period_us = live_period_us != 0 ? live_period_us : std::max(robot.sample_period_us, 1U);
  const std::uint64_t reported_at_us = std::max(robot.latest_robot_time_us, next_sample_at_robot_us);
  const std::uint64_t on_their_way = (reported_at_us - next_sample_at_robot_us + period_us - 1) / period_us;
  return {robot.boot_id, robot.next_seq + on_their_way, utc_us};
}

void ReportedConfiguration::begin_connection() {
  settings_.begin_again();
  reported_kinds_.clear();
}

void ReportedConfiguration::begin_boot() {
  clock_sync_ = ClockSync{};
  clock_recorded_ = ClockRecord{};
}

std::optional<InForceRecord> ReportedConfiguration::add(const protocol::ParameterPage& page,
                                                        const ReportMoment& moment) {
  if (!settings_.parameters.add(page)) return std::nullopt;
  settings_.parameters_at_us = moment.utc_us;
  return record(settings_.parameters.last_known(), moment);
}

InForceRecord ReportedConfiguration::add(const protocol::Controller& controller,
                                         const std::optional<protocol::Controller>& former,
                                         const ReportMoment& moment) {
  settings_.add(controller, former, moment.utc_us);
  return record(controller, moment);
}

InForceRecord ReportedConfiguration::record(InForceContent content, const ReportMoment& moment) {
  InForceRecord record;
  record.boot_id = moment.boot_id;
  record.is_change = !reported_kinds_.insert(content.index()).second;
  record.first_seq = moment.first_seq;
  record.content = std::move(content);
  record.noticed_at_us = moment.utc_us;
  return record;
}

ReportedConfiguration::ClockReport ReportedConfiguration::add(const ClockExchange& exchange, const RobotState& robot,
                                                              std::int64_t utc_minus_steady_us) {
  clock_sync_.add(exchange);
  ClockReport report;
  report.estimate = clock_sync_.estimate();
  const ClockEstimate& clock = report.estimate;
  if (!clock.valid) return report;
  ClockRecord record;
  record.boot_id = robot.boot_id;
  record.robot_time_us = robot.latest_robot_time_us;
  record.utc_offset_us = clock.offset_us + utc_minus_steady_us;
  record.uncertainty_us = clock.uncertainty_us(robot.latest_robot_time_us);
  record.drift_ppm = clock.drift_ppm;
  record.round_trip_us = clock.round_trip_us;

  const ClockRecord& before = clock_recorded_;
  const bool is_first = before.boot_id == 0;
  const std::int64_t step_us = is_first ? 0 : utc_minus_steady_us - utc_minus_steady_us_;
  utc_minus_steady_us_ = utc_minus_steady_us;
  if (std::abs(step_us) >= kStationStepUs) report.station_step_us = record.station_step_us = step_us;
  const std::int64_t moved_us = std::abs(record.utc_offset_us - record.station_step_us - before.utc_offset_us);
  const bool is_due = is_first || record.station_step_us != 0 ||
                      moved_us > record.uncertainty_us + before.uncertainty_us ||
                      record.robot_time_us >= before.robot_time_us + kClockRecordPeriodUs;
  if (is_due) report.record = clock_recorded_ = record;
  return report;
}

}  // namespace server::station
