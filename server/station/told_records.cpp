// What a robot tells now and then and what is recorded of it: its clock, its parameters and its controller.
#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "server/station/read_back.hpp"
#include "server/station/seat.hpp"

namespace server {
namespace {

constexpr std::int64_t kClockRecordPeriodUs = 60'000'000;
constexpr std::int64_t kStationStepUs = 50'000;  // within a second; what NTP slews is far below

std::vector<const protocol::Command*> commands_of(const std::vector<std::shared_ptr<PendingCommand>>& sent) {
  std::vector<const protocol::Command*> commands;
  for (const auto& pending : sent) commands.push_back(&pending->wire);
  return commands;
}

}  // namespace

void Station::on_clock(RobotPort& port, const ClockExchange& exchange) {
  Seat* seat = seat_of(port);
  if (seat == nullptr) return;
  seat->clock_sync.add(exchange);
  seat->robot->clock = seat->clock_sync.estimate();
  if (seat->robot->clock.valid) record_clock(*seat);
}

// Once a minute, when the estimate has moved by more than either says it may be wrong, and when the station's own UTC
// was set. The estimate itself is against steady time, which nobody sets.
void Station::record_clock(Seat& seat) {
  const RobotState& robot = *seat.robot;
  const ClockEstimate& clock = robot.clock;
  const std::int64_t utc_minus_steady_us = clock_.utc_us() - clock_.steady_us();
  ClockRecord record;
  record.boot_id = robot.boot_id;
  record.robot_time_us = robot.latest_robot_time_us;
  record.utc_offset_us = clock.offset_us + utc_minus_steady_us;
  record.uncertainty_us = clock.uncertainty_us(robot.latest_robot_time_us);
  record.drift_ppm = clock.drift_ppm;
  record.round_trip_us = clock.round_trip_us;

  const ClockRecord& before = seat.clock_recorded;
  const bool is_first = before.boot_id == 0;
  const std::int64_t step_us = is_first ? 0 : utc_minus_steady_us - seat.utc_minus_steady_us;
  seat.utc_minus_steady_us = utc_minus_steady_us;
  if (std::abs(step_us) >= kStationStepUs) {
    record.station_step_us = step_us;
    note(robot, "station_clock_set", fmt::format("by {} ms", step_us / 1000));
  }
  const std::int64_t moved_us = std::abs(record.utc_offset_us - record.station_step_us - before.utc_offset_us);
  const bool due = is_first || record.station_step_us != 0 ||
                   moved_us > record.uncertainty_us + before.uncertainty_us ||
                   record.robot_time_us >= before.robot_time_us + kClockRecordPeriodUs;
  if (!due) return;
  seat.clock_recorded = record;
  for (StationSink* sink : sinks_) sink->on_clock(robot, record);
}

void Station::on_parameters(RobotPort& port, const protocol::ParameterPage& page) {
  Seat* seat = seat_of(port);
  if (seat == nullptr) return;
  RobotSettings& settings = seat->settings;
  if (auto table = settings.parameters.add(page)) {
    record_in_force(*seat, "parameters", std::move(*table));
    settings.parameters_at_us = clock_.utc_us();
    if (auto changed = settings.parameters.changed_limits(); changed != seat->robot->changed_limits) {
      seat->robot->changed_limits = std::move(changed);
      publish(*seat->robot);
    }
  }
  const auto sent = seat->to_be_read_back();
  settle_read_back(*seat, sent, read_back(commands_of(sent), page));
}

void Station::on_controller(RobotPort& port, const protocol::Controller& controller) {
  Seat* seat = seat_of(port);
  if (seat == nullptr) return;
  const auto sent = seat->to_be_read_back();
  ControllerReading reading = read_back(commands_of(sent), seat->settings, controller);
  seat->settings.add(controller, std::move(reading.former), clock_.utc_us());
  record_in_force(*seat, "controller", controller_json(controller));
  settle_read_back(*seat, sent, reading.sights);
}

// Samples that were made before it was said may still be on their way: they are counted on, in periods.
void Station::record_in_force(Seat& seat, std::string kind, std::string content) {
  const RobotState& robot = *seat.robot;
  const std::uint32_t live_period_us = robot.context.period_us;
  const std::uint64_t period_us = live_period_us != 0 ? live_period_us : std::max(robot.sample_period_us, 1U);
  const std::uint64_t said_at_us = std::max(robot.latest_robot_time_us, seat.next_sample_at_robot_us);
  InForceRecord record;
  record.boot_id = robot.boot_id;
  record.is_change = !seat.told_in_force.insert(kind).second;
  record.kind = std::move(kind);
  record.first_seq = robot.next_seq + (said_at_us - seat.next_sample_at_robot_us + period_us - 1) / period_us;
  record.content = std::move(content);
  record.noticed_at_us = clock_.utc_us();
  for (StationSink* sink : sinks_) sink->on_in_force(robot, record);
}

}  // namespace server
