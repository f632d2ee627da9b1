// SQL of runs, for readers.
#include "server/storage/runs/run_queries.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/runtime/sha256.hpp"
#include "server/storage/database/statement.hpp"
#include "server/storage/samples/boot_times.hpp"

namespace server::storage {

const char* const kRunColumns =
    "run_id, robot_id, name, fluid, pump_profile, mean_flow_m_s, tube, operator_name, notes, verdict,"
    " firmware_version, controller_id, controller_checksum, parameters_checksum, started_at_us, ended_at_us, state,"
    " made_afterwards, made_by, profile";

namespace {

constexpr std::int64_t kInterruptionsSince = 12;  // schema

Run run_from(SQLite::Statement& row) {
  Run run;
  run.id = row.getColumn(0).getInt64();
  run.robot_id = row.getColumn(1).getString();
  run.conditions.name = row.getColumn(2).getString();
  run.conditions.fluid = row.getColumn(3).getString();
  run.conditions.pump_profile = row.getColumn(4).getString();
  if (!row.getColumn(5).isNull()) run.conditions.mean_flow_m_s = row.getColumn(5).getDouble();
  run.conditions.tube = row.getColumn(6).getString();
  run.conditions.operator_name = row.getColumn(7).getString();
  run.conditions.notes = row.getColumn(8).getString();
  run.conditions.verdict = row.getColumn(9).getString();
  run.firmware_version = row.getColumn(10).getString();
  run.controller_id = row.getColumn(11).getUInt();
  run.controller_checksum = row.getColumn(12).getUInt();
  run.parameters_checksum = row.getColumn(13).getUInt();
  run.started_at_us = row.getColumn(14).getInt64();
  if (!row.getColumn(15).isNull()) run.ended_at_us = row.getColumn(15).getInt64();
  run.state = run_state_from(row.getColumn(16).getString()).value_or(RunState::open);
  run.made_afterwards = row.getColumn(17).getInt() != 0;
  run.made_by = row.getColumn(18).getString();
  run.conditions.profile = row.getColumn(19).getString();
  return run;
}

constexpr std::uint64_t kNoEnd = std::numeric_limits<std::int64_t>::max();

constexpr const char* kAnyInterruption =
    "SELECT 1 FROM event WHERE boot_key = ? AND kind = 'experiment_interrupted' LIMIT 1";
constexpr const char* kInterruptionsOver =
    "SELECT event_row, robot_time_us, value, cause, detail FROM event WHERE boot_key = ?1"
    " AND kind = 'experiment_interrupted' AND robot_time_us < ?3 AND robot_time_us + value * 1e6 >= ?2"
    " ORDER BY robot_time_us";
// Of a run whose station may have been killed: a run that was made afterwards goes on past a kill, and what its robot
// did then was no waiting. No index has them, so that they are looked for by their time: within a minute, since a run
// that is cut off ends with its last sample.
constexpr const char* kInterruptionsBegun =
    "SELECT event_row, robot_time_us, value, cause, detail FROM run JOIN event USING (robot_id)"
    " WHERE run_id = ?1 AND state IN ('open', 'interrupted')"
    " AND received_at_us >= started_at_us - 60000000"
    " AND received_at_us <= coalesce(ended_at_us + 60000000, 9223372036854775807)"
    " AND boot_key = ?2 AND kind = 'experiment_paused' ORDER BY event_row";
constexpr const char* kNewestSegment =
    "SELECT last_seq FROM segment WHERE boot_key = ? ORDER BY first_seq DESC LIMIT 1";

// The parts of a run in which its experiment was interrupted: from an event `experiment_paused` to the
// `experiment_interrupted` that follows. A station that was killed has left the first of them alone: such a part lasts
// until the next one begins, or until the span ends; of a span that is open, until its newest stored sample.
class Interruptions {
 public:
  explicit Interruptions(SQLite::Database& database)
      : any_{database, kAnyInterruption},
        over_{database, kInterruptionsOver},
        begun_{database, kInterruptionsBegun},
        newest_{database, kNewestSegment},
        times_{database} {}

  // Those of the run's last span, as far as they lie in it: an experiment may have made more than is of this run.
  void add_to(Run& run, std::int64_t boot_key) {
    bind_all(begun_, run.id, boot_key);
    std::vector<Mark> begun = read(begun_);
    bind_all(any_, boot_key);
    if (!any_.executeStep() && begun.empty()) return;
    times_.enter(boot_key);
    const RunSpan& span = run.spans.back();
    const auto first = times_.of(span.first_seq);
    const auto next = span.last_seq ? times_.of(*span.last_seq + 1) : std::nullopt;
    const std::uint64_t begins_us = first ? first->robot_time_us : 0;
    const std::uint64_t ends_us = next ? next->robot_time_us : kNoEnd;
    bind_all(over_, boot_key, begins_us, ends_us);
    std::vector<Mark> marks = read(over_);
    std::erase_if(begun, [&](const Mark& mark) { return mark.from_us < begins_us || mark.from_us >= ends_us; });
    keep_without_end(begun, marks);
    for (Mark& mark : begun) {
      if (mark.to_us == kNoEnd) mark.to_us = next ? ends_us : stored_until_us(boot_key);
      marks.push_back(std::move(mark));
    }
    std::ranges::stable_sort(marks, {}, &Mark::from_us);
    for (Mark& mark : marks) {
      InterruptedPart part{static_cast<std::uint32_t>(run.spans.size() - 1), std::max(mark.from_us, begins_us),
                           std::min(mark.to_us, ends_us), std::move(mark.reason), std::move(mark.detail)};
      if (part.from_robot_us < part.to_robot_us) run.interrupted.push_back(std::move(part));
    }
  }

 private:
  struct Mark {
    std::int64_t row = 0;
    std::uint64_t from_us = 0, to_us = 0;
    std::string reason, detail;
  };

  static std::vector<Mark> read(SQLite::Statement& query) {
    std::vector<Mark> marks;
    while (query.executeStep()) {
      const std::uint64_t from_us = unsigned_id(query.getColumn(1));
      const auto length_us = static_cast<std::uint64_t>(std::llround(1e6 * query.getColumn(2).getDouble()));
      marks.push_back({query.getColumn(0).getInt64(), from_us, from_us + length_us, query.getColumn(3).getString(),
                       query.getColumn(4).getString()});
    }
    return marks;
  }

  // The end of a wait is stored before the beginning of the next; a wait without one lasts until then.
  static void keep_without_end(std::vector<Mark>& begun, const std::vector<Mark>& over) {
    std::vector<Mark> kept;
    for (std::size_t k = 0; k < begun.size(); ++k) {
      const Mark* next = k + 1 < begun.size() ? &begun[k + 1] : nullptr;
      const auto ends_it = [&](const Mark& mark) {
        return mark.row > begun[k].row && (next == nullptr || mark.row < next->row);
      };
      if (std::ranges::any_of(over, ends_it)) continue;
      kept.push_back(begun[k]);
      kept.back().to_us = next == nullptr ? kNoEnd : next->from_us;
    }
    begun = std::move(kept);
  }

  std::uint64_t stored_until_us(std::int64_t boot_key) {
    bind_all(newest_, boot_key);
    const auto next = newest_.executeStep() ? times_.of(unsigned_id(newest_.getColumn(0)) + 1) : std::nullopt;
    return next ? next->robot_time_us : 0;
  }

  SQLite::Statement any_, over_, begun_, newest_;
  BootTimes times_;
};

// Without the profile, which may be long, where its hash is stored.
constexpr const char* kOrigin =
    "SELECT experiment_id, number, profile_sha256, iif(profile_sha256 IS NULL, profile, '') FROM run_origin"
    " WHERE run_id = ?";

std::optional<RunOrigin> origin_of(SQLite::Statement& origin, RunId id) {
  bind_all(origin, id);
  if (!origin.executeStep()) return std::nullopt;
  const SQLite::Column sha256 = origin.getColumn(2);
  return RunOrigin{origin.getColumn(0).getInt64(), origin.getColumn(1).getUInt(),
                   sha256.isNull() ? runtime::sha256_of(origin.getColumn(3).getString()) : sha256.getString()};
}

// Fills in spans, counts and origin, run by run.
class RunReading {
 public:
  RunReading(SQLite::Database& database, const BootHeads& heads) : database_{database}, heads_{heads} {}

  void complete(Run& run) {
    const bool has_digest = read_digest(run);
    run.origin = origin_of(origin_, run.id);
    bind_all(spans_, run.id);
    while (spans_.executeStep()) {
      const std::int64_t boot_key = spans_.getColumn(0).getInt64();
      RunSpan span{
          .boot_id = unsigned_id(spans_.getColumn(1)), .first_seq = unsigned_id(spans_.getColumn(2)), .last_seq = {}};
      if (!spans_.getColumn(3).isNull()) span.last_seq = unsigned_id(spans_.getColumn(3));
      run.spans.push_back(span);
      interruptions_.add_to(run, boot_key);
      if (!has_digest) count(run, span, boot_key, unsigned_id(spans_.getColumn(4)));
    }
  }

 private:
  bool read_digest(Run& run) {
    bind_all(digest_, run.id);
    if (!digest_.executeStep()) return false;
    run.samples_expected = unsigned_id(digest_.getColumn(0));
    run.samples_stored = unsigned_id(digest_.getColumn(1));
    run.samples_lost = unsigned_id(digest_.getColumn(2));
    if (!digest_.isColumnNull(3)) {
      run.missed = MissedTicks{unsigned_id(digest_.getColumn(3)), unsigned_id(digest_.getColumn(4))};
    }
    return true;
  }

  // Below `settled` every sample is stored or lost, so there only the gaps are read.
  void count(Run& run, const RunSpan& span, std::int64_t boot_key, std::uint64_t settled) {
    const std::uint64_t next =
        span.last_seq ? *span.last_seq + 1 : known_next_seq(database_, heads_, boot_key, span.boot_id);
    if (next <= span.first_seq) return;
    settled = std::clamp(settled, span.first_seq, next);
    const std::uint64_t lost = sum(lost_, boot_key, span.first_seq, next - 1);
    run.samples_expected += next - span.first_seq;
    run.samples_lost += lost;
    if (settled > span.first_seq) {
      run.samples_stored += settled - span.first_seq - sum(lost_, boot_key, span.first_seq, settled - 1);
    }
    if (settled < next) run.samples_stored += sum(stored_, boot_key, settled, next - 1);
  }

  static std::uint64_t sum(SQLite::Statement& query, std::int64_t boot_key, std::uint64_t first, std::uint64_t last) {
    bind_all(query, boot_key, first, last);
    query.executeStep();
    return unsigned_id(query.getColumn(0));
  }

  SQLite::Database& database_;
  const BootHeads& heads_;
  SQLite::Statement digest_{database_,
                            "SELECT samples_expected, samples_live + samples_backfilled, samples_lost, missed_ticks,"
                            " longest_missed_ticks FROM run_certificate WHERE run_id = ?"};
  SQLite::Statement spans_{database_,
                           "SELECT boot_key, boot_id, first_seq, last_seq, durable_next_seq"
                           " FROM run_span JOIN boot USING (boot_key) WHERE run_id = ? ORDER BY span"};
  SQLite::Statement stored_{database_,
                            "SELECT coalesce(sum(min(last_seq, ?3) - max(first_seq, ?2) + 1), 0) FROM segment"
                            " WHERE boot_key = ?1 AND first_seq BETWEEN ?2 - 99 AND ?3 AND last_seq >= ?2"};
  SQLite::Statement lost_{database_,
                          "SELECT coalesce(sum(min(last_seq, ?3) - max(first_seq, ?2) + 1), 0) FROM gap"
                          " WHERE boot_key = ?1 AND first_seq <= ?3 AND last_seq >= ?2"};
  SQLite::Statement origin_{database_, kOrigin};
  Interruptions interruptions_{database_};
};

}  // namespace

const char* text(RunState value) {
  switch (value) {
    case RunState::open: return "open";
    case RunState::ended: return "ended";
    case RunState::interrupted: return "interrupted";
    case RunState::discarded: return "discarded";
  }
  return "open";
}

std::optional<RunState> run_state_from(const std::string& name) {
  for (const RunState state : {RunState::open, RunState::ended, RunState::interrupted, RunState::discarded}) {
    if (name == text(state)) return state;
  }
  return std::nullopt;
}

std::optional<Run> find_run(SQLite::Database& database, const BootHeads& heads, RunId id) {
  SQLite::Statement query{database, fmt::format("SELECT {} FROM run WHERE run_id = ?", kRunColumns)};
  bind_all(query, id);
  if (!query.executeStep()) return std::nullopt;
  Run run = run_from(query);
  RunReading{database, heads}.complete(run);
  return run;
}

std::optional<PerformedProfile> read_performed_profile(SQLite::Database& database, RunId id) {
  const SQLite::Transaction moment{database};
  SQLite::Statement row{database, kOrigin};
  auto origin = origin_of(row, id);
  if (!origin) return std::nullopt;
  SQLite::Statement performed{database, "SELECT variant, profile FROM run_origin WHERE run_id = ?"};
  bind_all(performed, id);
  performed.executeStep();
  return PerformedProfile{std::move(*origin), performed.getColumn(0).getString(), performed.getColumn(1).getString()};
}

std::vector<InterruptedPart> read_interrupted_parts(SQLite::Database& database, RunId id) {
  Run run;
  run.id = id;
  if (database.execAndGet("PRAGMA user_version").getInt64() < kInterruptionsSince) return {};
  Interruptions interruptions{database};
  SQLite::Statement spans{database,
                          "SELECT boot_key, first_seq, last_seq FROM run_span WHERE run_id = ? ORDER BY span"};
  bind_all(spans, id);
  while (spans.executeStep()) {
    RunSpan span{.boot_id = 0, .first_seq = unsigned_id(spans.getColumn(1)), .last_seq = {}};
    if (!spans.getColumn(2).isNull()) span.last_seq = unsigned_id(spans.getColumn(2));
    run.spans.push_back(span);
    interruptions.add_to(run, spans.getColumn(0).getInt64());
  }
  return std::move(run.interrupted);
}

std::optional<RunState> read_run_state(SQLite::Database& database, RunId id) {
  SQLite::Statement query{database, "SELECT state FROM run WHERE run_id = ?"};
  bind_all(query, id);
  if (!query.executeStep()) return std::nullopt;
  return run_state_from(query.getColumn(0).getString());
}

std::vector<Run> list_runs(SQLite::Database& database, const BootHeads& heads, const RunFilter& filter) {
  SQLite::Statement query{database, fmt::format("SELECT {} FROM run WHERE (?1 IS NULL OR robot_id = ?1)"
                                                " AND (?2 = 0 OR run_id < ?2)"
                                                " AND iif(?3 IS NULL, state <> 'discarded', state = ?3)"
                                                " ORDER BY run_id DESC LIMIT ?4",
                                                kRunColumns)};
  std::optional<std::string> state;
  if (filter.state) state = text(*filter.state);
  bind_all(query, filter.robot_id, filter.before, state, static_cast<std::int64_t>(filter.limit));
  std::vector<Run> runs;
  while (query.executeStep()) runs.push_back(run_from(query));
  RunReading reading{database, heads};
  for (Run& run : runs) reading.complete(run);
  return runs;
}

std::optional<RunConditions> last_flow_of(SQLite::Database& database, const station::RobotId& robot_id) {
  SQLite::Statement query{database, fmt::format("SELECT {} FROM run WHERE robot_id = ? AND pump_profile <> ''"
                                                " AND made_afterwards = 0 AND state <> 'discarded'"
                                                " ORDER BY run_id DESC LIMIT 1",
                                                kRunColumns)};
  bind_all(query, robot_id);
  if (!query.executeStep()) return std::nullopt;
  return run_from(query).conditions;
}

std::vector<InterruptedRun> read_interrupted(SQLite::Database& database, const std::vector<RunId>& ids) {
  SQLite::Statement row{
      database,
      "SELECT robot_id, name, iif(EXISTS (SELECT 1 FROM run_span WHERE run_id = ?1), ended_at_us, NULL), fluid"
      " FROM run WHERE run_id = ?1"};
  std::vector<InterruptedRun> runs;
  for (const RunId id : ids) {
    bind_all(row, id);
    if (!row.executeStep()) continue;
    InterruptedRun run{.id = id,
                       .robot_id = row.getColumn(0).getString(),
                       .name = row.getColumn(1).getString(),
                       .fluid = row.getColumn(3).getString(),
                       .last_sample_at_us = {}};
    if (!row.getColumn(2).isNull()) run.last_sample_at_us = row.getColumn(2).getInt64();
    runs.push_back(std::move(run));
  }
  return runs;
}

std::vector<RunId> interrupted_since_start(SQLite::Database& database) {
  SQLite::Statement entries{database, "SELECT action, subject FROM audit ORDER BY entry DESC LIMIT 10000"};
  std::vector<RunId> ids;
  while (entries.executeStep()) {
    const std::string action = entries.getColumn(0).getString();
    if (action == "station.started") break;
    if (action == "run.interrupted") ids.push_back(entries.getColumn(1).getInt64());
  }
  std::ranges::reverse(ids);
  return ids;
}

std::optional<RunSnapshot> read_snapshot(SQLite::Database& database, RunId id) {
  SQLite::Statement run{database, fmt::format("SELECT {} FROM run WHERE run_id = ?", kRunColumns)};
  bind_all(run, id);
  if (!run.executeStep()) return std::nullopt;
  const Run found = run_from(run);
  RunSnapshot snapshot{
      found.firmware_version, found.controller_id, found.controller_checksum, found.parameters_checksum, {}};
  SQLite::Statement rows{database,
                         "SELECT span, kind, first_seq, content FROM run_in_force WHERE run_id = ? ORDER BY 1, 2, 3"};
  bind_all(rows, id);
  while (rows.executeStep()) {
    snapshot.in_force.push_back({rows.getColumn(0).getUInt(), rows.getColumn(1).getString(),
                                 unsigned_id(rows.getColumn(2)), rows.getColumn(3).getString()});
  }
  return snapshot;
}

std::uint64_t known_next_seq(SQLite::Database& database, station::BootId boot_id) {
  SQLite::Statement key{database, "SELECT boot_key FROM boot WHERE boot_id = ?"};
  bind_all(key, boot_id);
  return key.executeStep() ? known_next_seq(database, {}, key.getColumn(0).getInt64(), boot_id) : 0;
}

std::uint64_t known_next_seq(SQLite::Database& database, const BootHeads& heads, std::int64_t boot_key,
                             station::BootId boot_id) {
  SQLite::Statement query{
      database,
      "SELECT max(announced_next_seq,"
      " coalesce((SELECT last_seq + 1 FROM segment WHERE boot_key = ?1 ORDER BY first_seq DESC LIMIT 1), 0),"
      " coalesce((SELECT last_seq + 1 FROM gap WHERE boot_key = ?1 ORDER BY first_seq DESC LIMIT 1), 0))"
      " FROM boot WHERE boot_key = ?1"};
  bind_all(query, boot_key);
  query.executeStep();
  const auto head = heads.find(boot_id);
  return std::max(unsigned_id(query.getColumn(0)), head == heads.end() ? 0 : head->second);
}

}  // namespace server::storage
