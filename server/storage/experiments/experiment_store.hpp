// SQL of the experiments: a row each, a row for each of their runs, and an entry of the audit for what people do.
//
// Each call is one transaction. Of those that have ended the newest kMaxKeptExperiments are kept.
// Errors: SQLite::Exception.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/station/state/audit_note.hpp"
#include "server/storage/database/database.hpp"
#include "server/storage/experiments/experiment.hpp"

namespace server::storage {

inline constexpr std::int64_t kMaxKeptExperiments = 10'000;

// A new one, at the end of its robot's queue: sets id and place.
void add_experiment(Database& database, Experiment& experiment, const station::AuditNote& note);

// State, reason, detail, acts_for, is_held, priority, place and times, with an entry of the audit if there is one.
void store_experiment(Database& database, const Experiment& experiment,
                      const std::optional<station::AuditNote>& note = {});

// A run that has begun, with its prediction (JSON, empty: none) and, for good, its origin; and how it ended.
void add_experiment_run(Database& database, ExperimentId id, const ExperimentRun& run, const std::string& prediction);
void end_experiment_run(Database& database, ExperimentId id, const ExperimentRun& run);
void note_knowledge(Database& database, ExperimentId id, const ExperimentRun& run);  // its knowledge

// A robot that is to be brought to rest in nobody's name, and was not seen at rest since.
struct OwedRest {
  station::RobotId robot_id;
  station::BootId boot_id = 0;  // that moves; 0: whichever
  std::string why;              // for people
};

// SAFETY: after a restart of the station nothing goes on by itself: what had begun is interrupted, what waited is held.
// Returns the robots that are owed rest: those whose experiment was interrupted, by this restart or an earlier one, and
// those of owe_rest().
std::vector<OwedRest> interrupt_experiments(Database& database, std::int64_t utc_us);

std::vector<OwedRest> owed_rests(Database& database);
void owe_rest(Database& database, const OwedRest& owed, std::int64_t utc_us);
void note_rest(Database& database, const station::RobotId& robot_id);  // it is owed none any more

std::optional<Experiment> find_experiment(SQLite::Database& database, ExperimentId id);
// Each with the counts of its runs, and without the runs.
std::vector<Experiment> list_experiments(SQLite::Database& database, const ExperimentFilter& filter);
std::vector<Experiment> waiting_experiments(SQLite::Database& database);  // in no order
// Of a run of an experiment, as JSON; none: there is no such run, or no prediction of it.
std::optional<std::string> experiment_prediction(SQLite::Database& database, ExperimentId id, std::uint32_t number);

}  // namespace server::storage
