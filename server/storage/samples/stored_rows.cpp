// Column lists stand beside the functions that read them.
#include "server/storage/samples/stored_rows.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "server/storage/database/statement.hpp"
#include "server/storage/samples/command_store.hpp"

namespace server::storage {
namespace {

station::CommandState command_state_from(const std::string& name) {
  for (int value = 0; value <= static_cast<int>(station::kLastCommandState); ++value) {
    if (name == text(static_cast<station::CommandState>(value))) return static_cast<station::CommandState>(value);
  }
  return station::CommandState::failed;
}

constexpr const char* kUnfinished = "state IN ('queued', 'sent')";
constexpr const char* kRestarted = "station_restarted";

}  // namespace

void set_unknown(station::SampleContext& context, const std::string& unknown_values) {
  const auto numbers = nlohmann::json::parse(unknown_values, nullptr, false);
  if (!numbers.is_object()) return;
  station::for_each_batch_field_of<station::FieldKind::enumerator>(
      [&]<class Enumerator>(const station::BatchField<Enumerator>& field) {
        const auto number = numbers.find(field.name);
        if (number == numbers.end() || !number->is_number_integer()) return;
        context.*field.member = static_cast<Enumerator>(number->template get<std::int32_t>());
      });
}

std::string select_commands(const char* condition) {
  return fmt::format(
      "SELECT command_id, robot_id, boot_id, kind, arguments, actor, state, reason, submitted_at_us, sent_at_us,"
      " ended_at_us, effect_at_robot_us, emergency_id, coalesce(sent_after_us, -1), coalesce(acknowledged_after_us, "
      "-1),"
      " coalesce(verified_after_us, -1), life_from, peer, audit_entry, further_renewals,"
      " coalesce(last_renewed_at_us, 0) FROM command {}",
      condition);
}

station::CommandRecord command_from(SQLite::Statement& row) {
  station::CommandRecord command;
  command.id = unsigned_id(row.getColumn(0));
  command.robot_id = row.getColumn(1).getString();
  command.boot_id = unsigned_id(row.getColumn(2));
  command.kind = row.getColumn(3).getString();
  command.arguments = row.getColumn(4).getString();
  command.actor = row.getColumn(5).getString();
  command.state = command_state_from(row.getColumn(6).getString());
  command.reason = row.getColumn(7).getString();
  command.submitted_at_us = row.getColumn(8).getInt64();
  command.sent_at_us = row.getColumn(9).getInt64();
  command.ended_at_us = row.getColumn(10).getInt64();
  command.effect_at_robot_us = unsigned_id(row.getColumn(11));
  command.emergency_id = unsigned_id(row.getColumn(12));
  command.sent_after_us = row.getColumn(13).getInt64();
  command.acknowledged_after_us = row.getColumn(14).getInt64();
  command.verified_after_us = row.getColumn(15).getInt64();
  command.life_from = row.getColumn(16).getString();
  command.peer = row.getColumn(17).getString();
  command.further_renewals.reset();
  if (!row.getColumn(19).isNull()) command.further_renewals = unsigned_id(row.getColumn(19));
  command.last_renewed_at_us = row.getColumn(20).getInt64();
  return command;
}

std::string select_events(const char* condition) {
  return fmt::format(
      "SELECT event.robot_id, boot.boot_id, event_seq, robot_time_us, sample_seq, kind, cause, mode, sub_state,"
      " position_m, value, emergency_id, command_id, received_at_us, emergency_cause, detail, event.unknown_values, "
      "event_row FROM event LEFT JOIN boot "
      "USING (boot_key) {}",
      condition);
}

station::RobotEvent event_from(SQLite::Statement& row) {
  station::RobotEvent event;
  event.robot_id = row.getColumn(0).getString();
  event.boot_id = unsigned_id(row.getColumn(1));
  if (!row.getColumn(2).isNull()) event.event_seq = unsigned_id(row.getColumn(2));
  event.robot_time_us = unsigned_id(row.getColumn(3));
  event.sample_seq = unsigned_id(row.getColumn(4));
  event.kind = row.getColumn(5).getString();
  event.cause = row.getColumn(6).getString();
  station::SampleContext context;
  context.mode = enumerator_from<protocol::Mode>(row.getColumn(7).getString());
  context.sub_state = enumerator_from<protocol::SubState>(row.getColumn(8).getString());
  context.emergency_cause = enumerator_from<protocol::EmergencyCause>(row.getColumn(14).getString());
  if (!row.getColumn(16).isNull()) event.unknown_values = row.getColumn(16).getString();
  if (event.unknown_values) set_unknown(context, *event.unknown_values);
  event.mode = context.mode;
  event.sub_state = context.sub_state;
  event.position_m = float_or_nan(row.getColumn(9));
  event.value = float_or_nan(row.getColumn(10));
  event.emergency_id = unsigned_id(row.getColumn(11));
  event.command_id = unsigned_id(row.getColumn(12));
  event.received_at_us = row.getColumn(13).getInt64();
  if (!row.getColumn(14).isNull()) event.emergency_cause = context.emergency_cause;
  event.detail = row.getColumn(15).getString();
  return event;
}

std::vector<station::CommandRecord> pending_stops(Database& database) {
  std::vector<station::CommandRecord> stops;
  const std::string condition =
      fmt::format("WHERE kind = 'emergency_stop' AND {} ORDER BY submitted_at_us", kUnfinished);
  SQLite::Statement query{database.handle(), select_commands(condition.c_str())};
  while (query.executeStep()) stops.push_back(command_from(query));
  return stops;
}

namespace {

// How many followed, and until when, nobody knows any more.
std::vector<station::CommandRecord> renewals_that_went_on(Database& database) {
  std::vector<station::CommandRecord> renewals;
  SQLite::Statement query{database.handle(),
                          select_commands("WHERE further_renewals IS NULL AND reason <> ? ORDER BY submitted_at_us")};
  query.bind(1, kRestarted);
  while (query.executeStep()) renewals.push_back(command_from(query));
  return renewals;
}

}  // namespace

void end_unfinished_commands(Database& database, std::int64_t utc_us) {
  SQLite::Transaction transaction{database.handle(), SQLite::TransactionBehavior::IMMEDIATE};
  std::vector<station::CommandRecord> unfinished;
  const std::string condition = fmt::format("WHERE kind <> 'emergency_stop' AND {}", kUnfinished);
  SQLite::Statement query{database.handle(), select_commands(condition.c_str())};
  while (query.executeStep()) unfinished.push_back(command_from(query));
  CommandStore commands{database.handle()};
  AuditChain audit{database.handle()};
  for (station::CommandRecord& command : unfinished) {
    command.state =
        command.state == station::CommandState::sent ? station::CommandState::unknown : station::CommandState::failed;
    command.reason = kRestarted;
    command.ended_at_us = utc_us;
    commands.write(command, audit);
  }
  for (station::CommandRecord& renewal : renewals_that_went_on(database)) {
    renewal.reason = kRestarted;
    commands.write(renewal, audit);
  }
  transaction.commit();
}

}  // namespace server::storage
