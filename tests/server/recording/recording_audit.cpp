// Reads every row; the databases of these tests are small.
#include "tests/server/recording/recording_audit.hpp"

#include <fmt/format.h>

#include "server/storage/database/statement.hpp"
#include "server/storage/upkeep/audit_check.hpp"

namespace server {
namespace {

station::CommandState next(station::CommandState state) {
  return static_cast<station::CommandState>(static_cast<int>(state) + 1);
}

class Audit {
 public:
  Audit(SQLite::Database& database, const RecordingTruth& truth) : database_{database}, truth_{truth} {}

  Faults of_everything(bool complete) {
    check_file();
    check_rows();
    for (const auto& [boot_id, boot] : truth_.boots) check_boot(boot_id, boot, complete);
    check_commands();
    check_records();
    for (const std::string& broken : storage::check_audit(database_, {}).faults) faults_.push_back(broken);
    return std::move(faults_);
  }

 private:
  template <class... Values>
  void fault(fmt::format_string<Values...> sentence, Values&&... values) {
    faults_.push_back(fmt::format(sentence, std::forward<Values>(values)...));
  }

  std::int64_t number(const std::string& sql) { return database_.execAndGet(sql).getInt64(); }

  void check_file() {
    const std::string integrity = database_.execAndGet("PRAGMA integrity_check").getString();
    if (integrity != "ok") fault("integrity_check: {}", integrity);
    SQLite::Statement foreign{database_, "PRAGMA foreign_key_check"};
    if (foreign.executeStep()) fault("a row of {} has no parent", foreign.getColumn(0).getString());
    if (number("PRAGMA page_size") != 4096 || number("PRAGMA auto_vacuum") != 2) fault("the file has other settings");
    const auto store_id = storage::unsigned_id(database_.execAndGet("SELECT value FROM meta WHERE name = 'store_id'"));
    if (truth_.store_id != 0 && store_id != truth_.store_id) fault("another store_id than robots were told");
  }

  void check_rows() {
    const std::int64_t newest = number(
        "SELECT max(coalesce((SELECT max(row) FROM sample), 0),"
        " coalesce((SELECT max(last_row) FROM segment), 0))");
    if (number("SELECT value FROM meta WHERE name = 'next_row'") <= newest)
      fault("next_row is not beyond row {}", newest);
    const std::int64_t in_segments = number("SELECT coalesce(sum(last_row - first_row + 1), 0) FROM segment");
    const std::int64_t samples = number("SELECT count(*) FROM sample");
    if (samples != in_segments) fault("{} rows of samples, {} in segments", samples, in_segments);
    const std::int64_t joined =
        number("SELECT count(*) FROM segment JOIN sample ON row BETWEEN first_row AND last_row");
    if (joined != samples) fault("{} rows belong to segments, of {}", joined, samples);
  }

  // Adds the ranges of a query (first, last) to the set; a number that is in there already is a fault.
  void add(storage::IntervalSet& set, station::BootId boot_id, const char* what, const std::string& sql) {
    SQLite::Statement query{database_, sql};
    storage::bind_all(query, boot_id);
    while (query.executeStep()) {
      const storage::Interval range{storage::unsigned_id(query.getColumn(0)),
                                    storage::unsigned_id(query.getColumn(1)) + 1};
      if (count(set.insert(range)) != range.next - range.first) {
        fault("boot {:x}: {} {} to {} twice", boot_id, what, range.first, range.next - 1);
      }
    }
  }

  void check_boot(station::BootId boot_id, const BootTruth& boot, bool complete) {
    constexpr const char* kOfBoot =
        "SELECT {0}, {1} FROM {2} WHERE boot_key = (SELECT boot_key FROM boot WHERE boot_id = ?)";
    storage::IntervalSet stored;
    storage::IntervalSet gaps;
    add(stored, boot_id, "samples", fmt::format(kOfBoot, "first_seq", "last_seq", "segment"));
    add(gaps, boot_id, "gap", fmt::format(kOfBoot, "first_seq", "last_seq", "gap"));
    compare({boot_id, "sample", boot.made, boot.acknowledged, boot.let_go, boot.ended, complete}, stored, gaps);
    check_values(boot_id, boot);
    storage::IntervalSet events;
    storage::IntervalSet event_gaps;
    add(events, boot_id, "event",
        fmt::format(kOfBoot, "event_seq", "event_seq", "event") + " AND event_seq IS NOT NULL");
    add(event_gaps, boot_id, "event gap", fmt::format(kOfBoot, "first_event_seq", "last_event_seq", "event_gap"));
    compare({boot_id, "event", boot.events_made, boot.events_acknowledged, boot.events_let_go, boot.ended, complete},
            events, event_gaps);
  }

  struct Claim {
    station::BootId boot_id = 0;
    const char* noun = "";
    std::uint64_t made = 0;
    std::uint64_t acknowledged = 0;
    const storage::IntervalSet& let_go;
    bool ended = false;
    bool complete = false;
  };

  void compare(const Claim& claim, const storage::IntervalSet& stored, const storage::IntervalSet& gaps) {
    storage::IntervalSet both = stored;
    for (const storage::Interval& gap : gaps.covered({0, ~0ULL})) {
      if (count(both.insert(gap)) != gap.next - gap.first) {
        fault("boot {:x}: {} {} to {} is stored and a gap", claim.boot_id, claim.noun, gap.first, gap.next - 1);
      }
      for (const storage::Interval& part : claim.let_go.missing(gap)) {
        fault("boot {:x}: {} {} to {} is a gap, but the robot had not lost it", claim.boot_id, claim.noun, part.first,
              part.next - 1);
      }
    }
    const std::uint64_t wanted = claim.complete && !claim.ended ? claim.made : claim.acknowledged;
    for (const storage::Interval& hole : both.missing({0, wanted})) {
      fault("boot {:x}: {} {} to {} is neither stored nor a gap; acknowledged below {}, made {}", claim.boot_id,
            claim.noun, hole.first, hole.next - 1, claim.acknowledged, claim.made);
    }
    if (both.end() > claim.made) fault("boot {:x}: {} {} was never made", claim.boot_id, claim.noun, both.end() - 1);
  }

  void check_values(station::BootId boot_id, const BootTruth& boot) {
    SQLite::Statement wrong{database_,
                            "SELECT first_seq + row - first_row FROM boot JOIN segment USING (boot_key)"
                            " JOIN sample ON row BETWEEN first_row AND last_row WHERE boot_id = ?"
                            " AND (abs(position_m - (first_seq + row - first_row) / 1000.0) > 1e-3"
                            " OR impedance_mv <> ? OR robot_id <> ?)"};
    storage::bind_all(wrong, boot_id, boot.impedance_mv, boot.robot_id);
    if (wrong.executeStep()) fault("boot {:x}: sample {} has another's values", boot_id, wrong.getColumn(0).getInt64());
    SQLite::Statement event{database_,
                            "SELECT event_seq FROM boot JOIN event USING (boot_key) WHERE boot_id = ?"
                            " AND value <> event_seq"};
    storage::bind_all(event, boot_id);
    if (event.executeStep()) fault("boot {:x}: event {} has another's values", boot_id, event.getColumn(0).getInt64());
  }

  void check_commands() {
    SQLite::Statement query{database_, "SELECT state FROM command WHERE command_id = ?"};
    for (const auto& [id, command] : truth_.commands) {
      if (!command.flushed) continue;
      storage::bind_all(query, id);
      if (!query.executeStep()) {
        fault("command {} is gone", id);
        continue;
      }
      const std::string stored = query.getColumn(0).getString();
      const bool is_by_restart =
          stored == text(station::CommandState::failed) || stored == text(station::CommandState::unknown);
      bool is_possible = is_by_restart && !command.is_stop;
      for (station::CommandState state = *command.flushed; state <= command.latest; state = next(state)) {
        is_possible = is_possible || stored == text(state);
      }
      if (!is_possible) fault("command {} is {}, it was {}", id, stored, text(*command.flushed));
    }
  }

  void check_records() {
    SQLite::Statement event{database_, "SELECT count(*) FROM event WHERE boot_key IS NULL AND sample_seq = ?"};
    for (const std::uint64_t number : truth_.station_events) {
      storage::bind_all(event, number);
      event.executeStep();
      if (event.getColumn(0).getInt64() != 1) fault("the station's event {} is not there once", number);
    }
    SQLite::Statement run{database_, "SELECT count(*) FROM run WHERE run_id = ?"};
    for (const std::int64_t run_id : truth_.runs) {
      storage::bind_all(run, run_id);
      run.executeStep();
      if (run.getColumn(0).getInt64() != 1) fault("run {} is gone", run_id);
    }
  }

  SQLite::Database& database_;
  const RecordingTruth& truth_;
  Faults faults_;
};

}  // namespace

Faults audit(SQLite::Database& database, const RecordingTruth& truth) {
  return Audit{database, truth}.of_everything(false);
}

Faults audit_complete(SQLite::Database& database, const RecordingTruth& truth) {
  return Audit{database, truth}.of_everything(true);
}

}  // namespace server
