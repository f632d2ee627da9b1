// An experiment as a value: a profile that a robot is to perform, run after run, and what became of it.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/station/state/station_state.hpp"
#include "server/storage/runs/run.hpp"

namespace server::storage {

using ExperimentId = std::int64_t;

enum class ExperimentState : std::uint8_t {
  waiting,  // in the queue of its robot
  running,
  paused,    // the robot is at rest; somebody resumes it, or it is aborted
  aborting,  // until the robot is at rest
  done,
  aborted,      // `reason`
  cancelled,    // before it began
  interrupted,  // the station stopped before it had ended
};
const char* text(ExperimentState value);
std::optional<ExperimentState> experiment_state_from(const std::string& text);
inline bool has_ended(ExperimentState state) { return state >= ExperimentState::done; }

struct ExperimentRequest {
  station::RobotId robot_id;
  std::string name;           // of the profile
  std::string profile;        // its document, TOML or JSON
  std::string notes;          // of every run
  std::int64_t priority = 0;  // -100 to 100; the highest begins first
  bool is_unattended = false;
};

// One run of the grid.
struct ExperimentRun {
  std::uint32_t number = 0;  // from 1
  ExperimentState state = ExperimentState::running;
  std::optional<RunId> run;        // none: it did not come to one
  std::string reason;              // as of Experiment
  std::string variant = "{}";      // JSON: fluid, controller, factors, repeat
  std::string steps = "[]";        // JSON: when each step began, in the time of the robot
  std::string knowledge;           // JSON: what the fit after it knew, with `until`; empty: nothing
  std::int64_t started_at_us = 0;  // UTC, as the next
  std::optional<std::int64_t> ended_at_us;
  bool has_prediction = false;
};

// Runs of an experiment that have begun, by their state.
using RunCounts = std::map<ExperimentState, std::uint32_t>;
RunCounts counts_of(const std::vector<ExperimentRun>& runs);

struct Experiment {
  ExperimentId id = 0;
  ExperimentState state = ExperimentState::waiting;
  ExperimentRequest request;
  std::string owner;     // the actor who asked for it
  std::string acts_for;  // the actor in whose name it commands the robot
  std::string client;    // of that actor, the page or program in whose hands it is; not on disk. Empty: it has no id
  std::string reason;    // of paused and of one that ended, for programs, e.g. "nobody_present"; empty: none
  std::string detail;    // the same in words
  // SAFETY: it does not begin before somebody has released it, after an abort or a restart of the station.
  bool is_held = false;
  std::int64_t place = 0;  // in the queue, among those of one priority
  std::uint32_t runs_planned = 0;
  double duration_s = 0;  // of all runs, without what is between them
  std::int64_t created_at_us = 0;
  std::optional<std::int64_t> started_at_us, ended_at_us;
  RunCounts run_counts;
  std::vector<ExperimentRun> runs;  // that have begun; of one in a list none
};

// Newest first.
struct ExperimentFilter {
  std::optional<station::RobotId> robot_id;
  std::optional<ExperimentState> state;
  ExperimentId before = 0;  // 0: from the newest
  std::size_t limit = 100;
};

}  // namespace server::storage
