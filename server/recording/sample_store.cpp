// Prepared statements, one transaction per batch; row numbers come from a counter that is stored with the rows.
#include "server/recording/sample_store.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "server/recording/statement.hpp"

namespace server {
namespace {

constexpr const char* kInsertSample =
    "INSERT INTO sample (row, position_m, velocity_m_s, acceleration_m_s2, duty, impedance_mv, reference_m)"
    " VALUES (?,?,?,?,?,?,?)";
constexpr const char* kInsertSegment =
    "INSERT INTO segment (boot_key, first_seq, last_seq, first_row, last_row, first_robot_time_us, period_us,"
    " first_received_at_us, received_at_us, utc_offset_us, clock_uncertainty_us, mode, sub_state, setpoint_m,"
    " disturbance_m, position_sd_m, controller_id, emergency_id, emergency_cause, flags, min_position_m, "
    "max_position_m,"
    " min_velocity_m_s, max_velocity_m_s, min_acceleration_m_s2, max_acceleration_m_s2, min_duty, max_duty,"
    " min_impedance_mv, max_impedance_mv, min_reference_m, max_reference_m)"
    " VALUES (?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?, ?,?,?,?,?,?,?,?,?,?,?,?)";
constexpr const char* kInsertGap =
    "INSERT INTO gap (boot_key, first_seq, last_seq, cause, noticed_at_us) VALUES (?,?,?,?,?)";
constexpr const char* kInsertEventGap =
    "INSERT INTO event_gap (boot_key, first_event_seq, last_event_seq, cause, noticed_at_us) VALUES (?,?,?,?,?)";
constexpr const char* kInsertEvent =
    "INSERT INTO event (robot_id, boot_key, event_seq, robot_time_us, sample_seq, kind, cause, mode, sub_state,"
    " position_m, value, emergency_id, command_id, received_at_us) VALUES (?,?,?,?,?,?,?,?,?,?,?,?,?,?)";
constexpr const char* kUpsertCommand =
    "INSERT OR REPLACE INTO command (command_id, robot_id, boot_id, kind, arguments, actor, state, reason,"
    " submitted_at_us, sent_at_us, ended_at_us, effect_at_robot_us, emergency_id) VALUES (?,?,?,?,?,?,?,?,?,?,?,?,?)";

// The smallest and largest finite value of one channel; NaN (stored as NULL) when there is none.
struct Extremes {
  float min = std::numeric_limits<float>::quiet_NaN();
  float max = std::numeric_limits<float>::quiet_NaN();
};

Extremes extremes(const std::vector<Sample>& samples, float Sample::* channel) {
  Extremes found;
  for (const Sample& sample : samples) {
    if (!std::isfinite(sample.*channel)) continue;
    found.min = std::fmin(found.min, sample.*channel);
    found.max = std::fmax(found.max, sample.*channel);
  }
  return found;
}

}  // namespace

bool WriteBatch::empty() const {
  return segments.empty() && gaps.empty() && events.empty() && event_gaps.empty() && commands.empty() && boots.empty();
}

SampleStore::SampleStore(Database& database)
    : database_{database},
      boots_{database},
      next_row_{database.handle().execAndGet("SELECT value FROM meta WHERE name = 'next_row'").getInt64()},
      insert_sample_{database.handle(), kInsertSample},
      insert_segment_{database.handle(), kInsertSegment},
      insert_gap_{database.handle(), kInsertGap},
      insert_event_{database.handle(), kInsertEvent},
      insert_event_gap_{database.handle(), kInsertEventGap},
      upsert_command_{database.handle(), kUpsertCommand},
      advance_row_{database.handle(), "UPDATE meta SET value = ? WHERE name = 'next_row' AND value = ?"},
      advance_boot_{database.handle(),
                    "UPDATE boot SET last_robot_time_us = max(last_robot_time_us, ?) WHERE boot_key = ?"} {}

void SampleStore::write(const WriteBatch& batch) {
  SQLite::Transaction transaction{database_.handle(), SQLite::TransactionBehavior::IMMEDIATE};
  std::int64_t next_row = next_row_;
  for (const Segment& segment : batch.segments) next_row = write_segment(segment, next_row);
  for (const LostRange& gap : batch.gaps) {
    execute(insert_gap_, gap.boot_key, gap.lost.first, gap.lost.next - 1, gap.cause, gap.noticed_at_us);
  }
  for (const StoredEvent& event : batch.events) write_event(event);
  for (const LostRange& gap : batch.event_gaps) {
    execute(insert_event_gap_, gap.boot_key, gap.lost.first, gap.lost.next - 1, gap.cause, gap.noticed_at_us);
  }
  for (const CommandRecord& command : batch.commands) write_command(command);
  for (const BootStart& boot : batch.boots) boots_.start(boot);
  if (next_row != next_row_ && execute(advance_row_, next_row, next_row_) != 1) {
    throw std::runtime_error{"another program writes into the station's database; stop it"};
  }
  transaction.commit();
  next_row_ = next_row;
}

std::int64_t SampleStore::write_segment(const Segment& segment, std::int64_t first_row) {
  std::int64_t row = first_row;
  for (const Sample& sample : segment.samples) {
    execute(insert_sample_, row++, sample.position_m, sample.velocity_m_s, sample.acceleration_m_s2, sample.duty,
            sample.impedance_mv, sample.reference_m);
  }
  const SampleContext& context = segment.context;
  const Extremes position = extremes(segment.samples, &Sample::position_m);
  const Extremes velocity = extremes(segment.samples, &Sample::velocity_m_s);
  const Extremes acceleration = extremes(segment.samples, &Sample::acceleration_m_s2);
  const Extremes duty = extremes(segment.samples, &Sample::duty);
  const Extremes impedance = extremes(segment.samples, &Sample::impedance_mv);
  const Extremes reference = extremes(segment.samples, &Sample::reference_m);
  execute(insert_segment_, segment.boot_key, segment.first_seq, segment.next_seq() - 1, first_row, row - 1,
          segment.first_robot_time_us, context.period_us, segment.first_received_at_us, segment.received_at_us,
          segment.utc_offset_us, segment.clock_uncertainty_us, protocol::text(context.mode),
          protocol::text(context.sub_state), context.setpoint_m, context.disturbance_m, context.position_sd_m,
          context.controller_id, context.emergency_id, protocol::text(context.emergency_cause), context.flags,  //
          position.min, position.max, velocity.min, velocity.max, acceleration.min, acceleration.max,           //
          duty.min, duty.max, impedance.min, impedance.max, reference.min, reference.max);
  execute(advance_boot_, segment.robot_time_us(segment.samples.size() - 1), segment.boot_key);
  return row;
}

void SampleStore::write_event(const StoredEvent& stored) {
  const RobotEvent& event = stored.event;
  const auto boot_key = stored.boot_key == 0 ? std::nullopt : std::optional{stored.boot_key};
  execute(insert_event_, event.robot_id, boot_key, event.event_seq, event.robot_time_us, event.sample_seq, event.kind,
          event.cause, protocol::text(event.mode), protocol::text(event.sub_state), event.position_m, event.value,
          event.emergency_id, event.command_id, event.received_at_us);
}

void SampleStore::write_command(const CommandRecord& command) {
  execute(upsert_command_, command.id, command.robot_id, command.boot_id, command.kind, command.arguments,
          command.actor, text(command.state), command.reason, command.submitted_at_us, command.sent_at_us,
          command.ended_at_us, command.effect_at_robot_us, command.emergency_id);
}

}  // namespace server
