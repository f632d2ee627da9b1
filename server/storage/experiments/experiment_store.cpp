// A few statements for each call.
#include "server/storage/experiments/experiment_store.hpp"

#include <SQLiteCpp/SQLiteCpp.h>
#include <fmt/format.h>

#include "server/runtime/sha256.hpp"
#include "server/storage/audit/audit_chain.hpp"
#include "server/storage/database/statement.hpp"

namespace server::storage {
namespace {

constexpr const char* kExperimentColumns =
    "experiment_id, robot_id, name, profile, notes, priority, unattended, state, reason, detail, owner, acts_for, held,"
    " place, runs_planned, duration_s, created_at_us, started_at_us, ended_at_us";

std::optional<std::int64_t> time_or_none(const SQLite::Column& column) {
  return column.isNull() ? std::nullopt : std::optional{column.getInt64()};
}

Experiment experiment_of(SQLite::Statement& row) {
  Experiment experiment;
  experiment.id = row.getColumn(0).getInt64();
  experiment.request = {row.getColumn(1).getString(), row.getColumn(2).getString(), row.getColumn(3).getString(),
                        row.getColumn(4).getString(), row.getColumn(5).getInt64(),  row.getColumn(6).getInt() != 0};
  experiment.state = experiment_state_from(row.getColumn(7).getString()).value_or(ExperimentState::interrupted);
  experiment.reason = row.getColumn(8).getString();
  experiment.detail = row.getColumn(9).getString();
  experiment.owner = row.getColumn(10).getString();
  experiment.acts_for = row.getColumn(11).getString();
  experiment.is_held = row.getColumn(12).getInt() != 0;
  experiment.place = row.getColumn(13).getInt64();
  experiment.runs_planned = row.getColumn(14).getUInt();
  experiment.duration_s = row.getColumn(15).getDouble();
  experiment.created_at_us = row.getColumn(16).getInt64();
  experiment.started_at_us = time_or_none(row.getColumn(17));
  experiment.ended_at_us = time_or_none(row.getColumn(18));
  return experiment;
}

void read_experiment_runs(SQLite::Database& database, Experiment& experiment) {
  SQLite::Statement rows{
      database,
      "SELECT number, state, run_id, reason, variant, steps, started_at_us, ended_at_us,"
      " prediction IS NOT NULL, coalesce(knowledge, '') FROM experiment_run WHERE experiment_id = ? ORDER BY number"};
  bind_all(rows, experiment.id);
  while (rows.executeStep()) {
    ExperimentRun run;
    run.number = rows.getColumn(0).getUInt();
    run.state = experiment_state_from(rows.getColumn(1).getString()).value_or(ExperimentState::interrupted);
    run.run = time_or_none(rows.getColumn(2));
    run.reason = rows.getColumn(3).getString();
    run.variant = rows.getColumn(4).getString();
    run.steps = rows.getColumn(5).getString();
    run.started_at_us = rows.getColumn(6).getInt64();
    run.ended_at_us = time_or_none(rows.getColumn(7));
    run.has_prediction = rows.getColumn(8).getInt() != 0;
    run.knowledge = rows.getColumn(9).getString();
    experiment.runs.push_back(std::move(run));
  }
  experiment.run_counts = counts_of(experiment.runs);
}

void count_experiment_runs(SQLite::Statement& rows, Experiment& experiment) {
  bind_all(rows, experiment.id);
  while (rows.executeStep()) {
    const auto state = experiment_state_from(rows.getColumn(0).getString());
    experiment.run_counts[state.value_or(ExperimentState::interrupted)] += rows.getColumn(1).getUInt();
  }
}

void forget_ended(SQLite::Database& database) {
  constexpr const char* kOld =
      " WHERE experiment_id IN (SELECT experiment_id FROM experiment WHERE ended_at_us IS NOT NULL"
      " ORDER BY experiment_id DESC LIMIT -1 OFFSET ?)";
  SQLite::Statement runs{database, fmt::format("DELETE FROM experiment_run{}", kOld)};
  execute(runs, kMaxKeptExperiments);
  SQLite::Statement experiments{database, fmt::format("DELETE FROM experiment{}", kOld)};
  execute(experiments, kMaxKeptExperiments);
}

std::vector<Experiment> experiments_of(SQLite::Statement& rows) {
  std::vector<Experiment> experiments;
  while (rows.executeStep()) experiments.push_back(experiment_of(rows));
  return experiments;
}

}  // namespace

void add_experiment(Database& database, Experiment& experiment, const station::AuditNote& note) {
  SQLite::Database& handle = database.handle();
  SQLite::Transaction transaction{handle, SQLite::TransactionBehavior::IMMEDIATE};
  SQLite::Statement add{handle,
                        "INSERT INTO experiment (robot_id, name, profile, notes, priority, unattended, state, owner,"
                        " acts_for, place, runs_planned, duration_s, created_at_us) VALUES (?, ?, ?, ?, ?, ?,"
                        " 'waiting', ?, ?, (SELECT coalesce(max(place), 0) + 1 FROM experiment), ?, ?, ?)"
                        " RETURNING experiment_id, place"};
  const ExperimentRequest& request = experiment.request;
  bind_all(add, request.robot_id, request.name, request.profile, request.notes, request.priority,
           std::int64_t{request.is_unattended}, experiment.owner, experiment.acts_for, experiment.runs_planned,
           experiment.duration_s, experiment.created_at_us);
  add.executeStep();
  experiment.id = add.getColumn(0).getInt64();
  experiment.place = add.getColumn(1).getInt64();
  add.reset();
  forget_ended(handle);
  station::AuditNote entry = note;
  entry.subject = fmt::format("{}", experiment.id);
  AuditChain{handle}.append(entry);
  transaction.commit();
}

void store_experiment(Database& database, const Experiment& experiment, const std::optional<station::AuditNote>& note) {
  SQLite::Database& handle = database.handle();
  SQLite::Transaction transaction{handle, SQLite::TransactionBehavior::IMMEDIATE};
  SQLite::Statement update{handle,
                           "UPDATE experiment SET state = ?, reason = ?, detail = ?, acts_for = ?, held = ?,"
                           " priority = ?, place = ?, started_at_us = ?, ended_at_us = ? WHERE experiment_id = ?"
                           " AND ended_at_us IS NULL"};
  execute(update, text(experiment.state), experiment.reason, experiment.detail, experiment.acts_for,
          std::int64_t{experiment.is_held}, experiment.request.priority, experiment.place, experiment.started_at_us,
          experiment.ended_at_us, experiment.id);
  if (note) AuditChain{handle}.append(*note);
  transaction.commit();
}

void add_experiment_run(Database& database, ExperimentId id, const ExperimentRun& run, const std::string& prediction) {
  SQLite::Database& handle = database.handle();
  SQLite::Transaction transaction{handle, SQLite::TransactionBehavior::IMMEDIATE};
  SQLite::Statement add{handle,
                        "INSERT INTO experiment_run (experiment_id, number, state, run_id, variant, steps,"
                        " started_at_us, prediction) VALUES (?, ?, ?, ?, ?, ?, ?, nullif(?, ''))"};
  execute(add, id, run.number, text(run.state), run.run, run.variant, run.steps, run.started_at_us, prediction);
  SQLite::Statement origin{handle,
                           "INSERT INTO run_origin (run_id, experiment_id, number, variant, profile_sha256, profile)"
                           " SELECT ?, experiment_id, ?, ?, ?, profile FROM experiment WHERE experiment_id = ?"};
  SQLite::Statement profile{handle, "SELECT profile FROM experiment WHERE experiment_id = ?"};
  bind_all(profile, id);
  if (run.run && profile.executeStep()) {
    execute(origin, *run.run, run.number, run.variant, runtime::sha256_of(profile.getColumn(0).getString()), id);
  }
  transaction.commit();
}

void end_experiment_run(Database& database, ExperimentId id, const ExperimentRun& run) {
  SQLite::Statement end{database.handle(),
                        "UPDATE experiment_run SET state = ?, reason = ?, steps = ?, ended_at_us = ?"
                        " WHERE experiment_id = ? AND number = ?"};
  execute(end, text(run.state), run.reason, run.steps, run.ended_at_us, id, run.number);
}

void note_knowledge(Database& database, ExperimentId id, const ExperimentRun& run) {
  SQLite::Statement note{database.handle(),
                         "UPDATE experiment_run SET knowledge = ? WHERE experiment_id = ? AND number = ?"};
  execute(note, run.knowledge, id, run.number);
}

std::vector<OwedRest> interrupt_experiments(Database& database, std::int64_t utc_us) {
  SQLite::Database& handle = database.handle();
  SQLite::Transaction transaction{handle, SQLite::TransactionBehavior::IMMEDIATE};
  SQLite::Statement runs{handle,
                         "UPDATE experiment_run SET state = 'interrupted', reason = 'station_restarted',"
                         " ended_at_us = ? WHERE ended_at_us IS NULL"};
  execute(runs, utc_us);
  SQLite::Statement interrupt{handle,
                              "UPDATE experiment SET state = 'interrupted', reason = 'station_restarted',"
                              " detail = 'the station stopped while it ran', ended_at_us = ?, needs_rest = 1 WHERE "
                              "ended_at_us IS NULL AND state <> 'waiting'"};
  execute(interrupt, utc_us);
  SQLite::Statement hold{handle,
                         "UPDATE experiment SET held = 1, reason = 'station_restarted' WHERE state = 'waiting'"};
  hold.exec();
  std::vector<OwedRest> owed = owed_rests(database);
  transaction.commit();
  return owed;
}

std::vector<OwedRest> owed_rests(Database& database) {
  std::vector<OwedRest> owed;
  SQLite::Statement to_rest{database.handle(),
                            "SELECT DISTINCT robot_id, 0, 'its experiment was interrupted' FROM experiment"
                            " WHERE needs_rest = 1 UNION ALL SELECT robot_id, boot_id, why FROM rest_owed"};
  while (to_rest.executeStep()) {
    owed.push_back(
        {to_rest.getColumn(0).getString(), unsigned_id(to_rest.getColumn(1)), to_rest.getColumn(2).getString()});
  }
  return owed;
}

void owe_rest(Database& database, const OwedRest& owed, std::int64_t utc_us) {
  SQLite::Statement owe{database.handle(),
                        "INSERT OR REPLACE INTO rest_owed (robot_id, boot_id, why, since_us) VALUES (?, ?, ?, ?)"};
  execute(owe, owed.robot_id, owed.boot_id, owed.why, utc_us);
}

void note_rest(Database& database, const station::RobotId& robot_id) {
  SQLite::Transaction transaction{database.handle(), SQLite::TransactionBehavior::IMMEDIATE};
  for (const char* sql : {"UPDATE experiment SET needs_rest = 0 WHERE robot_id = ? AND needs_rest = 1",
                          "DELETE FROM rest_owed WHERE robot_id = ?"}) {
    SQLite::Statement seen{database.handle(), sql};
    execute(seen, robot_id);
  }
  transaction.commit();
}

std::optional<Experiment> find_experiment(SQLite::Database& database, ExperimentId id) {
  const SQLite::Transaction moment{database};
  SQLite::Statement row{database, fmt::format("SELECT {} FROM experiment WHERE experiment_id = ?", kExperimentColumns)};
  bind_all(row, id);
  if (!row.executeStep()) return std::nullopt;
  Experiment experiment = experiment_of(row);
  read_experiment_runs(database, experiment);
  return experiment;
}

std::vector<Experiment> list_experiments(SQLite::Database& database, const ExperimentFilter& filter) {
  const SQLite::Transaction moment{database};
  SQLite::Statement rows{
      database,
      fmt::format("SELECT {} FROM experiment WHERE (?1 IS NULL OR robot_id = ?1) AND (?2 IS NULL OR state = ?2)"
                  " AND (?3 = 0 OR experiment_id < ?3) ORDER BY experiment_id DESC LIMIT ?4",
                  kExperimentColumns)};
  const auto state = filter.state ? std::optional<std::string>{text(*filter.state)} : std::nullopt;
  bind_all(rows, filter.robot_id, state, filter.before, static_cast<std::int64_t>(filter.limit));
  std::vector<Experiment> experiments = experiments_of(rows);
  SQLite::Statement counts{database,
                           "SELECT state, count(*) FROM experiment_run WHERE experiment_id = ? GROUP BY state"};
  for (Experiment& experiment : experiments) count_experiment_runs(counts, experiment);
  return experiments;
}

std::vector<Experiment> waiting_experiments(SQLite::Database& database) {
  SQLite::Statement rows{database,
                         fmt::format("SELECT {} FROM experiment WHERE state = 'waiting'", kExperimentColumns)};
  return experiments_of(rows);
}

std::optional<std::string> experiment_prediction(SQLite::Database& database, ExperimentId id, std::uint32_t number) {
  SQLite::Statement row{database,
                        "SELECT prediction FROM experiment_run WHERE experiment_id = ? AND number = ?"
                        " AND prediction IS NOT NULL"};
  bind_all(row, id, number);
  if (!row.executeStep()) return std::nullopt;
  return row.getColumn(0).getString();
}

}  // namespace server::storage
