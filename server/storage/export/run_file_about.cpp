// Sorted by what a reader meets first.
#include "server/storage/export/run_file_about.hpp"

#include <string_view>

#include "server/storage/database/statement.hpp"

namespace server::storage {
namespace {

// `table` "": in every table that has the column; `column` "": the table itself.
struct Meaning {
  std::string_view table;
  std::string_view column;
  const char* meaning;
};

constexpr Meaning kMeanings[] = {
    {"about", "",
     "explains this file: a recorded run of a robot, exported from a Rheonaut station. A row explains a table"
     " or view (column_name is NULL) or one of its columns. Units are in the names (SI); *_us are"
     " microseconds, and *_at_us and utc_us count from 1970 (UTC). Begin with: SELECT t_s, position_m,"
     " setpoint_m, mode FROM sample"},
    {"run", "", "the run: one row"},
    {"sample", "", "the samples, in order of span and seq"},
    {"span", "",
     "parts of the run: each is a range of one boot's samples; a robot that rebooted during the run has several"},
    {"gap", "", "ranges of samples that are lost for good"},
    {"boot", "", "boots of the robot during the run"},
    {"clock", "", "estimates of the robot's clock during the run, one a minute and one at each jump"},
    {"event", "", "events that the robot reported, or that the station made about it"},
    {"command", "", "commands to the robot during the run, with their results"},
    {"audit", "",
     "who did what, from the run's beginning to its end without a hole: rheonaut verify --audit checks it"},
    {"marker", "", "notes at samples of the run"},
    {"run_certificate", "",
     "the run's digest, which states how complete it is; no row: the run had not ended, or samples"
     " were on their way"},
    {"in_force", "",
     "documents that were in force: the robot's parameters and controller, the station's configuration"},
    {"outside_reference", "", "where the position measured from outside is from; no row: there is none"},
    {"outside_position", "", "the run's position as it was measured from outside"},
    {"run_sample", "", "view: the samples, as in a station's database"},
    {"run_gap", "", "view: the gaps, as in a station's database"},
    {"robot_gap", "", "view: the gaps, as in a station's database; here those of this run"},
    {"robot_boot", "", "view: the boots, as in a station's database; here those of this run"},
    {"run_marker", "", "view: the markers, as in a station's database"},
    {"run_in_force", "", "view: the documents that were in force, as in a station's database"},
    {"boot_clock", "", "view: the estimates of the robot's clock, as in a station's database; here those of this run"},
    {"robot_event", "", "view: the events, as in a station's database; here those of this run"},
    {"robot_command", "", "view: the commands, as in a station's database; here those of this run"},

    {"about", "name", "table or view"},
    {"about", "column_name", "its column; NULL: the table or view itself"},
    {"about", "meaning", "what it is, in which unit, and what NULL means"},

    // What identifies a sample, and its times.
    {"", "run_id", "number of the run on its station"},
    {"", "robot_id", "name of the robot"},
    {"", "span", "number of the part of the run, from 0"},
    {"", "boot_id", "random number of the robot's boot, as decimal text since it may exceed 2^63; 0 or NULL: none"},
    {"", "seq", "number of the sample in its boot, from 0"},
    {"", "robot_time_us", "the robot's clock: microseconds since its boot"},
    {"", "t_s", "seconds since the first sample of the span, on the robot's clock"},
    {"", "utc_us", "the station's estimate of UTC, microseconds since 1970"},
    {"", "clock_uncertainty_us", "utc_us is right within ± this; -1: there was no estimate"},
    {"", "first_received_at_us",
     "when the first sample of its segment (about 1 s) had arrived; this one arrived between"
     " this time and received_at_us"},
    {"", "received_at_us", "when it arrived at the station; of a sample: when the last one of its segment had arrived"},

    // Fields of telemetry.
    {"", "position_m", "position: the robot's estimate, ± position_sd_m, plus disturbance_m; NULL: none"},
    {"", "velocity_m_s", "velocity that the robot estimates"},
    {"", "acceleration_m_s2", "measured acceleration"},
    {"", "duty", "motor command, -1 to 1"},
    {"", "impedance_mv", "voltage of the impedance sensor"},
    {"", "reference_m", "setpoint after the reference profile"},
    {"", "mode", "mode of the robot: manual, auto or emergency"},
    {"", "sub_state", "what it does in auto: navigating, holding or delivering; else none"},
    {"", "setpoint_m", "setpoint of the position; NULL: there is none"},
    {"", "disturbance_m", "disturbance that was added to the position on purpose"},
    {"", "position_sd_m", "one standard deviation of the position; NULL: not known"},
    {"", "controller_id", "number of the controller that was in force"},
    {"", "emergency_id", "random number of the emergency latch, as text; 0: not latched"},
    {"", "emergency_cause", "cause of the emergency latch; none: not latched"},
    {"", "flags", "bits of telemetry (docs/protocol.md); the lowest one: backfilled"},
    {"", "backfilled", "1: sent again, on request or after a reconnect"},
    {"", "gap_before", "samples that are missing right before this one"},
    {"", "gap_after", "samples that are missing after this one, to the end of its span"},
    {"", "unknown_values",
     "JSON: numbers of values that are given as 'unknown', since the station is older than the"
     " robot's firmware; NULL: there are none"},
    {"", "missed_ticks_before", "ticks at which the robot made no sample, right before this one"},

    // Run.
    {"run", "name", "name of the run"},
    {"", "fluid", "fluid that the robot swam in; empty: not known"},
    {"", "pump_profile", "what the pump did"},
    {"", "mean_flow_m_s", "mean flow; NULL: not known"},
    {"", "tube", "tube that the robot swam in"},
    {"", "operator_name", "who made the experiment"},
    {"", "notes", "notes of the operator"},
    {"", "verdict", "what the operator thinks of the run"},
    {"", "firmware_version", "version of the robot's firmware"},
    {"", "controller_checksum", "checksum of the controller at the beginning"},
    {"", "parameters_checksum", "checksum of the robot's parameters at the beginning"},
    {"", "started_at_us", "when the run began"},
    {"run", "ended_at_us", "when the run ended; NULL: it had not ended"},
    {"run", "state", "open, ended, interrupted (the station stopped) or discarded"},
    {"", "made_afterwards", "1: the run was made of samples that had been recorded before"},
    {"", "made_by", "who made the run"},
    {"", "profile", "profile of the experiment; empty: none"},

    // Ranges of samples, boots and clocks.
    {"", "first_seq", "number of the first sample of the range, or from which the document was in force"},
    {"", "last_seq", "number of the last sample of the range; NULL: still open"},
    {"gap", "cause", "why they are lost (docs/database.md)"},
    {"run_gap", "cause", "why they are lost (docs/database.md)"},
    {"robot_gap", "cause", "why they are lost (docs/database.md)"},
    {"robot_gap", "samples", "how many are lost"},
    {"", "noticed_at_us", "when the station knew that they are lost"},
    {"", "boot_key", "number of the boot on its station"},
    {"", "reset_cause", "why the robot booted"},
    {"", "sample_period_us", "time from sample to sample"},
    {"", "first_seen_at_us", "when the boot first connected"},
    {"", "utc_offset_us", "UTC is robot time plus this"},
    {"", "uncertainty_us", "the estimate is right within ± this"},
    {"", "drift_ppm", "growth of utc_offset_us in millionths: positive where the robot's clock is slow"},
    {"", "round_trip_us", "time of a message to the robot and back"},
    {"", "station_step_us", "by how much the station's own clock was set since the row before; 0: it was not"},

    // Events and commands.
    {"", "event_row", "number of the event on its station"},
    {"", "event_seq", "number of the event in its boot; NULL: made by the station"},
    {"", "sample_seq", "number of the sample at which it happened"},
    {"", "kind", "kind (docs/database.md)"},
    {"", "cause", "cause of the event itself"},
    {"", "value", "a number that belongs to the kind of event (docs/protocol.md)"},
    {"", "command_id", "random number of the command, as decimal text; 0: none"},
    {"", "detail", "a sentence for people; of the audit: JSON"},
    {"", "arguments", "arguments of the command, JSON"},
    {"", "actor", "who did it"},
    {"", "state", "how it ended: verified, acknowledged, rejected, expired, failed, superseded or unknown"},
    {"", "reason", "why it ended so"},
    {"", "submitted_at_us", "when it was requested"},
    {"", "sent_at_us", "when it was sent to the robot"},
    {"", "ended_at_us", "when its result was known"},
    {"", "effect_at_robot_us", "the robot's clock when it took effect; 0: not known"},
    {"", "sent_after_us", "time from the request to the sending; NULL: not sent"},
    {"", "acknowledged_after_us", "time from the request to the robot's answer; NULL: no answer"},
    {"", "verified_after_us", "time from the request to telemetry that shows the effect; NULL: not seen"},
    {"", "life_from", "from which time its validity counted: arrival, stamp or issued_at; empty: it does not expire"},
    {"", "further_renewals",
     "of a renewal of a lease: those that the robot accepted right after it and that have no row; NULL: unknown, or "
     "they"
     " went on"},
    {"", "last_renewed_at_us", "when the last of them was requested; NULL: there is none, or it is unknown"},

    // Audit (docs/database.md).
    {"", "entry", "number of the entry on its station, without holes"},
    {"", "at_us", "time of the action; this to salt are NULL where the entry is not of this run's robot"},
    {"", "peer", "address that the action came from"},
    {"", "action", "what was done"},
    {"", "subject", "to what it was done"},
    {"", "salt", "random bytes in content_hash"},
    {"", "content_hash", "BLAKE2b-256 of the entry"},
    {"", "hash", "BLAKE2b-256 of the hash of the entry before, the number and content_hash"},

    // Markers, digest, documents, reference.
    {"", "marker_id", "number of the marker on its station"},
    {"", "text", "text of the marker"},
    {"", "made_at_us", "when it was made"},
    {"", "format", "format of the digest (docs/database.md)"},
    {"", "samples_expected", "samples that the robot made in the run"},
    {"", "samples_live", "samples that arrived at once"},
    {"", "samples_backfilled", "samples that arrived when they were sent again"},
    {"", "samples_lost", "samples that are lost for good"},
    {"", "lost_by_cause", "lost samples by cause, JSON"},
    {"", "longest_gap_samples", "longest stretch without a sample, in samples"},
    {"", "longest_gap_us", "longest stretch without a sample, in time"},
    {"", "worst_clock_uncertainty_us", "largest clock_uncertainty_us; -1: no sample has an estimate"},
    {"", "samples_without_clock", "samples without an estimate of UTC"},
    {"", "missed_ticks", "ticks at which the robot made no sample; NULL: not counted"},
    {"", "longest_missed_ticks", "of them, the most in a row"},
    {"", "sha256", "SHA-256 of the document"},
    {"run_certificate", "sha256", "SHA-256 of the samples (docs/database.md)"},
    {"outside_reference", "sha256", "SHA-256 of the text that was imported"},
    {"", "content", "the document, JSON"},
    {"", "reference_id", "number of the import on its station"},
    {"", "source", "name of what was imported"},
    {"", "clock_method", "how its clock was aligned: offset, utc, marker or correlation"},
    {"", "clock_offset_s", "its time plus this is seconds since the first sample of the span"},
    {"", "clock_sd_s", "standard deviation of clock_offset_s; NULL: not known"},
    {"", "correlation", "correlation of both motions; NULL: another method"},
    {"", "motion_ratio", "its motion divided by the robot's own record of it; NULL: another method"},
    {"", "zero_is_kept", "0: zero_offset_m was estimated from the robot's own record"},
    {"", "zero_offset_m", "was added to its positions"},
    {"", "zero_sd_m", "standard deviation of zero_offset_m; NULL: not known"},
    {"outside_reference", "samples", "positions that were imported"},
    {"", "samples_left_out", "positions before or after the span, which were not"},
    {"", "completed_at_us", "when the import was complete"},
    {"", "removed_at_us", "when it was removed; NULL: in use"},
    {"", "removed_by", "who removed it"},
    {"", "removed_reason", "why it was removed"},
    {"outside_position", "position_m", "position measured from outside, with zero_offset_m"},
    {"outside_position", "position_sd_m", "its standard deviation"},
};

const char* meaning_of(std::string_view table, std::string_view column) {
  const char* found = "";
  for (const Meaning& row : kMeanings) {
    if (row.column != column) continue;
    if (row.table == table) return row.meaning;
    if (row.table.empty()) found = row.meaning;
  }
  return found;
}

}  // namespace

void explain_run_file(SQLite::Database& file) {
  file.exec("BEGIN; CREATE TABLE about (name TEXT NOT NULL, column_name TEXT, meaning TEXT NOT NULL)");
  SQLite::Statement insert{file, "INSERT INTO about VALUES (?, nullif(?, ''), ?)"};
  for (const Meaning& row : kMeanings) {
    if (row.column.empty()) execute(insert, std::string{row.table}, "", row.meaning);
  }
  // Columns in the order of the tables above.
  SQLite::Statement columns{file,
                            "SELECT about.name, made.name FROM about, pragma_table_info(about.name) AS made"
                            " WHERE column_name IS NULL ORDER BY about.rowid, made.cid"};
  std::vector<std::pair<std::string, std::string>> names;
  while (columns.executeStep()) names.emplace_back(columns.getColumn(0).getString(), columns.getColumn(1).getString());
  for (const auto& [table, column] : names) execute(insert, table, column, meaning_of(table, column));
  columns.reset();
  file.exec("COMMIT");
}

}  // namespace server::storage
