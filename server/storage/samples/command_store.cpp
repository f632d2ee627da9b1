// One statement, and the JSON of an entry.
#include "server/storage/samples/command_store.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "server/storage/database/statement.hpp"

namespace server::storage {
namespace {

// When it came into this state, as far as that is known.
std::int64_t changed_at_us(const station::CommandRecord& command) {
  if (command.last_renewed_at_us != 0) return command.last_renewed_at_us;
  if (command.ended_at_us != 0) return command.ended_at_us;
  const std::int64_t after_us = std::max({std::int64_t{0}, command.sent_after_us, command.acknowledged_after_us});
  return command.submitted_at_us + after_us;
}

}  // namespace

station::AuditNote audit_note_of(const station::CommandRecord& command) {
  nlohmann::json arguments = nlohmann::json::parse(command.arguments, nullptr, false);
  if (arguments.is_discarded()) arguments = command.arguments;
  nlohmann::json detail{{"kind", command.kind},
                        {"arguments", std::move(arguments)},
                        {"boot_id", std::to_string(command.boot_id)},
                        {"submitted_at_us", command.submitted_at_us}};
  const auto add_text = [&detail](const char* name, const std::string& text) {
    if (!text.empty()) detail[name] = text;
  };
  const auto add_time = [&detail](const char* name, std::int64_t time_us, std::int64_t none) {
    if (time_us != none) detail[name] = time_us;
  };
  add_text("reason", command.reason);
  add_text("life_from", command.life_from);
  add_time("sent_at_us", command.sent_at_us, 0);
  add_time("ended_at_us", command.ended_at_us, 0);
  add_time("sent_after_us", command.sent_after_us, -1);
  add_time("acknowledged_after_us", command.acknowledged_after_us, -1);
  add_time("verified_after_us", command.verified_after_us, -1);
  if (command.effect_at_robot_us != 0) detail["effect_at_robot_us"] = command.effect_at_robot_us;
  if (command.emergency_id != 0) detail["emergency_id"] = std::to_string(command.emergency_id);
  // 0 goes without saying: so it is in entries of before there was a number.
  const auto& further = command.further_renewals;
  if (further != 0) detail["further_renewals"] = further ? nlohmann::json(*further) : nlohmann::json(nullptr);
  add_time("last_renewed_at_us", command.last_renewed_at_us, 0);
  station::AuditNote note;
  note.by = {command.actor, command.peer, changed_at_us(command)};
  note.robot_id = command.robot_id;
  note.action = std::string{"command."} + text(command.state);
  note.subject = std::to_string(command.id);
  note.detail = station::audit_detail(detail);
  return note;
}

CommandStore::CommandStore(SQLite::Database& database)
    : upsert_{database,
              "INSERT OR REPLACE INTO command (command_id, robot_id, boot_id, kind, arguments, actor, state, reason,"
              " submitted_at_us, sent_at_us, ended_at_us, effect_at_robot_us, emergency_id, sent_after_us,"
              " acknowledged_after_us, verified_after_us, life_from, peer, audit_entry, further_renewals,"
              " last_renewed_at_us)"
              " VALUES (?,?,?,?,?,?,?,?,?,?,?,?,?,nullif(?,-1),nullif(?,-1),nullif(?,-1),?,?,?,?,nullif(?,0))"} {}

void CommandStore::write(const station::CommandRecord& command, AuditChain& audit) {
  const std::int64_t entry = audit.append(audit_note_of(command));
  execute(upsert_, command.id, command.robot_id, command.boot_id, command.kind, command.arguments, command.actor,
          text(command.state), command.reason, command.submitted_at_us, command.sent_at_us, command.ended_at_us,
          command.effect_at_robot_us, command.emergency_id, command.sent_after_us, command.acknowledged_after_us,
          command.verified_after_us, command.life_from, command.peer, entry, command.further_renewals,
          command.last_renewed_at_us);
}

}  // namespace server::storage
