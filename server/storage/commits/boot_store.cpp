// SQL of admission and of the succession of boots.
#include "server/storage/commits/boot_store.hpp"

#include <SQLiteCpp/Savepoint.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "server/runtime/exceptions.hpp"
#include "server/runtime/secrets.hpp"
#include "server/station/state/unknown_values.hpp"
#include "server/storage/audit/audit_chain.hpp"
#include "server/storage/database/statement.hpp"

namespace server::storage {
namespace {

bool matches(const SQLite::Column& stored, const std::string& token) {
  runtime::SecretHash hash{};
  if (static_cast<std::size_t>(stored.getBytes()) != hash.size()) return false;
  std::copy_n(static_cast<const unsigned char*>(stored.getBlob()), hash.size(), hash.begin());
  return runtime::same(hash, runtime::hash_of(token));
}

void set_token(SQLite::Statement& statement, int index, const std::string& token) {
  if (token.empty()) return statement.bind(index);
  const runtime::SecretHash hash = runtime::hash_of(token);
  statement.bind(index, hash.data(), static_cast<int>(hash.size()));
}

// Adds [0, from) and the ranges that begin there or later. Those before lie below: `from` is no sample of a range.
void add_intervals(SQLite::Database& database, const char* sql, std::int64_t boot_key, std::uint64_t from,
                   IntervalSet& set) {
  if (from > 0) set.insert({0, from});
  SQLite::Statement query{database, sql};
  bind_all(query, boot_key, from);
  while (query.executeStep()) set.insert({unsigned_id(query.getColumn(0)), unsigned_id(query.getColumn(1)) + 1});
}

}  // namespace

station::Admission refusal(protocol::RefusalReason reason, std::string detail) {
  station::Admission admission;
  admission.refusal = reason;
  admission.detail = std::move(detail);
  return admission;
}

station::Admission reused(const station::AdmissionRequest& request, const station::RobotId& owner) {
  return refusal(
      rheonaut_REFUSAL_REASON_BOOT_ID_REUSED,
      fmt::format("boot {} belongs to robot '{}'; a boot_id must be random, new in each boot", request.boot_id, owner));
}

station::Admission revoked(const station::RobotId& robot_id) {
  return refusal(rheonaut_REFUSAL_REASON_WRONG_TOKEN,
                 fmt::format("the token of robot '{}' was revoked; enrol the robot again", robot_id));
}

std::vector<station::RestoredRobot> BootStore::robots() {
  std::vector<station::RestoredRobot> robots;
  SQLite::Statement query{
      database_.handle(),
      "SELECT robot.robot_id, boot_id, coalesce(retired_at_us, 0), fluid FROM robot LEFT JOIN boot ON boot_key ="
      " (SELECT max(boot_key) FROM boot WHERE boot.robot_id = robot.robot_id)"
      " ORDER BY robot.robot_id"};
  while (query.executeStep()) {
    const station::RobotId robot_id = query.getColumn(0).getString();
    robots.push_back({.id = robot_id,
                      .boot_id = unsigned_id(query.getColumn(1)),
                      .emergency_id = latch_of(robot_id),
                      .retired_at_us = query.getColumn(2).getInt64(),
                      .fluid = query.getColumn(3).getString(),
                      .moves_for = mover_of(robot_id, unsigned_id(query.getColumn(1)))});
  }
  return robots;
}

// SAFETY: whose right must hold while it goes on doing what it was told; by a stop, or by the station, to rest.
std::string BootStore::mover_of(const station::RobotId& robot_id, station::BootId boot_id) {
  constexpr std::int64_t kLatest = 10'000;  // commands that are looked at
  SQLite::Statement last{database_.handle(),
                         "SELECT actor FROM (SELECT actor, boot_id, kind, submitted_at_us FROM command"
                         " WHERE robot_id = ? AND (sent_at_us > 0 OR kind = 'emergency_stop') ORDER BY submitted_at_us "
                         "DESC LIMIT ?) WHERE boot_id = ? AND kind IN"
                         " ('set_mode', 'set_setpoint', 'set_duty', 'set_duty_schedule', 'emergency_stop')"
                         " ORDER BY submitted_at_us DESC LIMIT 1"};
  bind_all(last, robot_id, kLatest, boot_id);
  return last.executeStep() ? last.getColumn(0).getString() : "";
}

// SAFETY: a boot that has connected and of which nothing is stored yet does not count: then the boot before it decides.
std::uint64_t BootStore::latch_of(const station::RobotId& robot_id) {
  SQLite::Statement boots{database_.handle(), "SELECT boot_key FROM boot WHERE robot_id = ? ORDER BY boot_key DESC"};
  bind_all(boots, robot_id);
  while (boots.executeStep()) {
    if (const auto latch = last_emergency(boots.getColumn(0).getInt64())) return *latch;
  }
  return 0;
}

// A change of the latch is an event and begins a new segment, and a stop has its own record: the latest of them counts.
// SAFETY: the record is on disk first, and of a robot that sends no events its segment comes only a second later.
std::optional<std::uint64_t> BootStore::last_emergency(std::int64_t boot_key) {
  SQLite::Statement segment{database_.handle(),
                            "SELECT first_robot_time_us, emergency_id FROM segment"
                            " WHERE boot_key = ? ORDER BY first_seq DESC LIMIT 1"};
  SQLite::Statement event{database_.handle(),
                          "SELECT robot_time_us, iif(kind = 'emergency', emergency_id, 0) FROM event"
                          " WHERE boot_key = ? AND event_seq IS NOT NULL AND kind IN ('emergency', 'emergency_cleared')"
                          " ORDER BY event_seq DESC LIMIT 1"};
  SQLite::Statement stop{
      database_.handle(),
      "SELECT effect_at_robot_us, command.emergency_id FROM boot JOIN command USING (robot_id, boot_id)"
      " WHERE boot_key = ? AND kind = 'emergency_stop' AND effect_at_robot_us > 0"
      " ORDER BY effect_at_robot_us DESC LIMIT 1"};
  std::optional<std::uint64_t> latch;
  std::int64_t known_at_robot_us = 0;
  for (SQLite::Statement* query : {&segment, &event, &stop}) {
    bind_all(*query, boot_key);
    if (!query->executeStep() || query->getColumn(0).getInt64() < known_at_robot_us) continue;
    known_at_robot_us = query->getColumn(0).getInt64();
    latch = unsigned_id(query->getColumn(1));
  }
  return latch;
}

std::int64_t BootStore::next_boot_key() {
  return database_.handle()
      .execAndGet(
          "SELECT max(coalesce((SELECT value FROM meta WHERE name = 'next_boot_key'), 1),"
          " coalesce((SELECT max(boot_key) FROM boot), 0) + 1)")
      .getInt64();
}

std::vector<AdmissionOutcome> BootStore::admit(const std::vector<AdmissionQuestion>& questions,
                                               const config::LoopbackEnrolment& enrolment) {
  try {
    return admit_together(questions, enrolment);
  } catch (const std::exception&) {  // one that cannot be stored keeps no other out: each by itself
  }
  std::vector<AdmissionOutcome> outcomes;
  for (const AdmissionQuestion& question : questions) {
    try {
      outcomes.push_back(admit_together({&question, 1}, enrolment).front());
    } catch (const std::exception& error) {
      spdlog::error("a robot cannot be admitted now: {}", runtime::text_of(error));
      outcomes.push_back({refusal(rheonaut_REFUSAL_REASON_STATION_BUSY,
                                  "the station's database cannot be used now; its log says why; try again"),
                          {}});
    }
  }
  return outcomes;
}

std::vector<AdmissionOutcome> BootStore::admit_together(std::span<const AdmissionQuestion> questions,
                                                        const config::LoopbackEnrolment& enrolment) {
  SQLite::Transaction transaction{database_.handle()};  // becomes a writing one only if a robot is new
  std::vector<AdmissionOutcome> outcomes;
  for (const AdmissionQuestion& question : questions) {
    SQLite::Savepoint savepoint{database_.handle(), "admission"};  // who is refused leaves nothing behind
    outcomes.push_back(admit_one(question, enrolment));
    if (outcomes.back().admission.refusal == rheonaut_REFUSAL_REASON_NONE) savepoint.release();
  }
  transaction.commit();
  return outcomes;
}

AdmissionOutcome BootStore::admit_one(const AdmissionQuestion& question, const config::LoopbackEnrolment& enrolment) {
  const station::AdmissionRequest& request = question.request;
  std::optional<station::RobotId> owner = question.owner;
  AdmissionOutcome outcome;
  outcome.admission = check_robot(request, enrolment);
  outcome.admission.store_id = database_.store_id();
  if (outcome.admission.refusal != rheonaut_REFUSAL_REASON_NONE) return outcome;

  if (!owner) {
    SQLite::Statement known{database_.handle(), "SELECT boot_key, robot_id FROM boot WHERE boot_id = ?"};
    bind_all(known, request.boot_id);
    if (known.executeStep()) {
      owner = known.getColumn(1).getString();
      if (owner == request.robot_id) outcome.boot = load(known.getColumn(0).getInt64());
    }
  }
  if (owner && owner != request.robot_id) outcome.admission = reused(request, *owner);
  return outcome;
}

station::Admission BootStore::check_robot(const station::AdmissionRequest& request,
                                          const config::LoopbackEnrolment& enrolment) {
  station::Admission admission;
  const bool may_enrol = enrolment.allowed && request.from_loopback;
  if (request.token.empty() && !request.from_loopback) {
    return refusal(rheonaut_REFUSAL_REASON_WRONG_TOKEN,
                   fmt::format("robot '{}' brings no token; without one a robot is admitted from loopback only",
                               request.robot_id));
  }
  SQLite::Statement known{database_.handle(),
                          "SELECT token_hash, revoked_at_us IS NOT NULL FROM robot WHERE robot_id = ?"};
  bind_all(known, request.robot_id);
  if (!known.executeStep()) {
    if (!may_enrol) {
      return refusal(rheonaut_REFUSAL_REASON_UNKNOWN_ROBOT,
                     fmt::format("robot '{}' is not enrolled: rheonaut robot enrol {} gives it a token",
                                 request.robot_id, request.robot_id));
    }
    if (auto full = check_room(request, enrolment)) return std::move(*full);
    SQLite::Statement add{database_.handle(),
                          "INSERT INTO robot (robot_id, enrolled_at_us, token_hash) VALUES (?, ?, ?)"};
    bind_all(add, request.robot_id, request.received_at_us);
    set_token(add, 3, request.token);
    add.exec();
    note_enrolled(request);
    admission.newly_enrolled = true;
    return admission;
  }
  if (known.getColumn(1).getInt() != 0) return revoked(request.robot_id);
  const SQLite::Column stored = known.getColumn(0);
  if (stored.isNull() ? request.token.empty() : matches(stored, request.token)) return admission;
  if (stored.isNull() && may_enrol) {  // enrolled without a token, brings one now: needed from here on
    SQLite::Statement add{database_.handle(), "UPDATE robot SET token_hash = ?2 WHERE robot_id = ?1"};
    bind_all(add, request.robot_id);
    set_token(add, 2, request.token);
    add.exec();
    note_enrolled(request);
    admission.newly_enrolled = true;
    return admission;
  }
  return refusal(rheonaut_REFUSAL_REASON_WRONG_TOKEN,
                 fmt::format("the token of robot '{}' is not the one it was enrolled with", request.robot_id));
}

// SAFETY: whatever runs on this machine cannot fill the lists of robots, and the stop of all, with names.
std::optional<station::Admission> BootStore::check_room(const station::AdmissionRequest& request,
                                                        const config::LoopbackEnrolment& enrolment) {
  SQLite::Statement count{database_.handle(),
                          "SELECT count(*), coalesce(sum(enrolled_at_us BETWEEN ?1 - 60000000 AND ?1), 0) FROM robot"
                          " WHERE enrolled_by = 'loopback' AND revoked_at_us IS NULL"};
  bind_all(count, request.received_at_us);
  count.executeStep();
  std::optional<station::Admission> refused;
  if (unsigned_id(count.getColumn(0)) >= enrolment.most_robots) {
    refused =
        refusal(rheonaut_REFUSAL_REASON_UNKNOWN_ROBOT,
                fmt::format("only {} robots of this machine enrol themselves: rheonaut robot enrol {}, or make room "
                            "with rheonaut robot revoke, or allow more by robots.max_enrolled_on_loopback",
                            enrolment.most_robots, request.robot_id));
  } else if (unsigned_id(count.getColumn(1)) >= enrolment.most_a_minute) {
    refused = refusal(rheonaut_REFUSAL_REASON_STATION_BUSY,
                      fmt::format("only {} robots of this machine enrol themselves a minute: try again later, or allow "
                                  "more by robots.enrolments_per_minute",
                                  enrolment.most_a_minute));
  }
  if (refused) refused->enrolment_full = true;
  return refused;
}

void BootStore::note_enrolled(const station::AdmissionRequest& request) {
  station::AuditNote note;
  note.by = {"loopback", "", request.received_at_us};
  note.robot_id = request.robot_id;
  note.action = "robot.enrolled";
  note.detail = request.token.empty() ? R"({"token":false})" : R"({"token":true})";
  AuditChain{database_.handle()}.append(note);
}

void BootStore::add(const std::vector<NewBoot>& boots) {
  if (boots.empty()) return;
  SQLite::Statement add{database_.handle(),
                        "INSERT INTO boot (boot_key, boot_id, robot_id, reset_cause, firmware_version,"
                        " sample_period_us, first_seen_at_us, announced_next_seq, announced_next_event_seq,"
                        " last_robot_time_us, unknown_values) VALUES (?,?,?,?,?,?,?,?,?,?,?)"};
  for (const auto& [boot_key, hello] : boots) {
    execute(add, boot_key, hello.boot_id, hello.robot_id, protocol::text(hello.reset_cause), hello.firmware_version,
            hello.sample_period_us, hello.received_at_us, hello.next_seq, hello.next_event_seq, hello.robot_time_us,
            station::UnknownValues{}.add("reset_cause", hello.reset_cause).text());
  }
  SQLite::Statement advance{database_.handle(),
                            "INSERT INTO meta (name, value) VALUES ('next_boot_key', ?)"
                            " ON CONFLICT (name) DO UPDATE SET value = excluded.value"};
  execute(advance, boots.back().boot_key + 1);
}

StoredBoot BootStore::find(const station::RobotId& robot_id, station::BootId boot_id) {
  SQLite::Statement known{database_.handle(), "SELECT boot_key FROM boot WHERE boot_id = ? AND robot_id = ?"};
  bind_all(known, boot_id, robot_id);
  return known.executeStep() ? load(known.getColumn(0).getInt64()) : StoredBoot{};
}

// Of a boot of an older program, where it is not stored how far it is recorded, all segments and gaps are read.
StoredBoot BootStore::load(std::int64_t boot_key) {
  StoredBoot boot;
  boot.key = boot_key;
  SQLite::Database& handle = database_.handle();
  SQLite::Statement query{handle,
                          "SELECT announced_next_seq, last_robot_time_us, durable_next_seq, durable_next_event_seq,"
                          " coalesce(connected_at_us, 0), announced_next_event_seq FROM boot WHERE boot_key = ?"};
  bind_all(query, boot_key);
  query.executeStep();
  const std::uint64_t next_seq = unsigned_id(query.getColumn(2));
  const std::uint64_t next_event_seq = unsigned_id(query.getColumn(3));
  add_intervals(handle,
                "SELECT first_seq, last_seq FROM segment WHERE boot_key = ? AND first_seq >= ? ORDER BY first_seq",
                boot_key, next_seq, boot.samples);
  add_intervals(handle, "SELECT first_seq, last_seq FROM gap WHERE boot_key = ? AND first_seq >= ?", boot_key, next_seq,
                boot.samples);
  add_intervals(handle,
                "SELECT event_seq, event_seq FROM event WHERE boot_key = ? AND event_seq >= ? ORDER BY event_seq",
                boot_key, next_event_seq, boot.events);
  add_intervals(handle,
                "SELECT first_event_seq, last_event_seq FROM event_gap WHERE boot_key = ? AND first_event_seq >= ?",
                boot_key, next_event_seq, boot.events);
  SQLite::Statement given_up{handle, "SELECT first_seq, last_seq FROM gap WHERE boot_key = ? AND cause = ?"};
  bind_all(given_up, boot_key, std::string{kGivenUp});
  while (given_up.executeStep()) {
    boot.given_up.insert({unsigned_id(given_up.getColumn(0)), unsigned_id(given_up.getColumn(1)) + 1});
  }
  boot.next_seq = std::max(unsigned_id(query.getColumn(0)), boot.samples.end());
  boot.next_event_seq = std::max(unsigned_id(query.getColumn(5)), boot.events.end());
  boot.last_robot_time_us = unsigned_id(query.getColumn(1));
  boot.connected_at_us = query.getColumn(4).getInt64();
  return boot;
}

void BootStore::start(const BootStart& start) {
  SQLite::Database& handle = database_.handle();
  // One that was admitted and has not connected is not older than this one.
  SQLite::Statement others{handle,
                           "SELECT boot_key FROM boot WHERE robot_id = ? AND boot_key <> ?"
                           " AND connected_at_us IS NOT NULL AND ended_next_seq IS NULL"};
  bind_all(others, start.robot_id, start.boot_key);
  std::vector<std::int64_t> ending;
  while (others.executeStep()) ending.push_back(others.getColumn(0).getInt64());
  for (const std::int64_t boot_key : ending) end(boot_key, start.noticed_at_us);

  // A boot that had ended and comes back goes on where it ended; any other boot belongs to the run from its beginning.
  SQLite::Statement continue_run{
      handle,
      "INSERT INTO run_span (run_id, span, boot_key, first_seq)"
      " SELECT run_id, (SELECT coalesce(max(span) + 1, 0) FROM run_span WHERE run_id = run.run_id), ?2,"
      " (SELECT coalesce(ended_next_seq, 0) FROM boot WHERE boot_key = ?2)"
      " FROM run WHERE robot_id = ?1 AND ended_at_us IS NULL"
      " AND NOT EXISTS (SELECT 1 FROM run_span WHERE run_id = run.run_id AND last_seq IS NULL)"};
  execute(continue_run, start.robot_id, start.boot_key);
  SQLite::Statement update{
      handle,
      "UPDATE boot SET ended_next_seq = NULL, connected_at_us = ?, announced_next_seq = max(announced_next_seq, ?),"
      " announced_next_event_seq = max(announced_next_event_seq, ?),"
      " last_robot_time_us = max(last_robot_time_us, ?) WHERE boot_key = ?"};
  execute(update, start.noticed_at_us, start.announced_next_seq, start.announced_next_event_seq, start.robot_time_us,
          start.boot_key);
}

void BootStore::set_fluid(const station::RobotId& robot_id, const std::string& fluid) {
  SQLite::Statement update{database_.handle(), "UPDATE robot SET fluid = ? WHERE robot_id = ?"};
  execute(update, fluid, robot_id);
}

void BootStore::end(std::int64_t boot_key, std::int64_t noticed_at_us) {
  SQLite::Database& handle = database_.handle();
  const StoredBoot boot = load(boot_key);
  SQLite::Statement add_gap{handle,
                            "INSERT INTO gap (boot_key, first_seq, last_seq, cause, noticed_at_us)"
                            " VALUES (?, ?, ?, ?, ?)"};
  const char* cause = boot.connected_at_us < database_.restored_at_us() ? "restore" : "reboot";
  for (const Interval& lost : boot.samples.missing({0, boot.next_seq})) {
    execute(add_gap, boot_key, lost.first, lost.next - 1, cause, noticed_at_us);
  }
  SQLite::Statement add_event_gap{handle,
                                  "INSERT INTO event_gap (boot_key, first_event_seq, last_event_seq, cause,"
                                  " noticed_at_us) VALUES (?, ?, ?, ?, ?)"};
  for (const Interval& lost : boot.events.missing({0, boot.next_event_seq})) {
    execute(add_event_gap, boot_key, lost.first, lost.next - 1, cause, noticed_at_us);
  }
  SQLite::Statement mark{handle,
                         "UPDATE boot SET ended_next_seq = ?1, durable_next_seq = ?1, durable_next_event_seq = ?2"
                         " WHERE boot_key = ?3"};
  execute(mark, boot.next_seq, boot.next_event_seq, boot_key);
  SQLite::Statement drop_empty{handle,
                               "DELETE FROM run_span WHERE boot_key = ? AND last_seq IS NULL AND first_seq >= ?"};
  execute(drop_empty, boot_key, boot.next_seq);
  SQLite::Statement close{handle, "UPDATE run_span SET last_seq = ?2 - 1 WHERE boot_key = ?1 AND last_seq IS NULL"};
  execute(close, boot_key, boot.next_seq);
}

}  // namespace server::storage
