// The position of a run as it was measured from outside, on the clock of the robot: what is stored of it.
//
// It stands beside what the robot recorded and is no part of the run's digest. A run has at most one in use; importing
// another one replaces it, with a reason. Its positions are written in pieces, and it is in use when all are there.
// Those of a reference that was removed, or whose run was discarded, are deleted in pieces.
//
// SQL on the thread that owns the handle; functions that write open their own transaction. A database of a schema
// before it has none.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "server/runtime/result.hpp"
#include "server/station/state/audit_note.hpp"
#include "server/storage/runs/run.hpp"

namespace server::storage {

// How the clock of the outside record was put onto the robot's.
enum class ReferenceClock : std::uint8_t { offset, utc, marker, correlation };
const char* text(ReferenceClock value);

struct OutsideReference {
  std::int64_t id = 0;
  RunId run = 0;
  std::uint32_t span = 0;  // of the run: all positions lie in it
  std::string source;      // a name, e.g. of the file
  std::string sha256;      // of the text that was imported, in lower-case hexadecimal
  ReferenceClock clock = ReferenceClock::offset;
  double clock_offset_s = 0;         // time in the text, plus this = seconds since the first sample of the span
  std::optional<double> clock_sd_s;  // none: not known
  std::optional<double> correlation, motion_ratio;  // of the method correlation: control/sensor/clock_alignment
  bool zero_is_kept = false;                        // else the zero was estimated
  double zero_offset_m = 0;                         // was added to the positions of the text
  std::optional<double> zero_sd_m;                  // none: not known
  std::uint64_t samples = 0, samples_left_out = 0;  // before or after the span
  std::string actor;
  std::int64_t made_at_us = 0;  // UTC
};

// Columns of equal length, in order of time; the zero is in the positions.
struct OutsidePositions {
  std::vector<std::uint64_t> robot_time_us;
  std::vector<double> position_m, position_sd_m;

  std::size_t size() const { return robot_time_us.size(); }
  void resize(std::size_t size) {
    robot_time_us.resize(size);
    position_m.resize(size);
    position_sd_m.resize(size);
  }
};

struct StoredReference {
  OutsideReference reference;
  OutsidePositions positions;
};

inline constexpr std::size_t kReferenceSlice = 2'000;  // positions that are written or deleted at once

// The one in use, if there is one.
std::optional<OutsideReference> find_reference(SQLite::Database& database, RunId run);
// Its positions after this robot time (none: from the first on), at most `limit`.
OutsidePositions read_positions(SQLite::Database& database, std::int64_t reference,
                                std::optional<std::uint64_t> after_us, std::size_t limit);
// Both, of one moment: positions of one that is replaced or removed meanwhile are all there.
std::optional<StoredReference> read_reference(SQLite::Database& database, RunId run,
                                              std::optional<std::uint64_t> after_us = {},
                                              std::size_t limit = std::numeric_limits<std::int64_t>::max());
// The one of a run's own file of SQLite (export/run_file), if it has one.
std::optional<StoredReference> read_exported_reference(SQLite::Database& file);
// Of one whose positions were read in pieces, and are fewer than it has.
Error changed_while_read(RunId run);

// not_found: no such run. conflict: it is open or discarded, or has a reference and no reason is given to replace it.
Result<void> check_may_import(SQLite::Database& database, RunId run, const std::string& reason);
// The same, and a row that is not in use yet; returns its id.
Result<std::int64_t> begin_reference(SQLite::Database& database, const OutsideReference& reference,
                                     const std::string& reason);
void add_positions(SQLite::Database& database, std::int64_t reference, const OutsidePositions& positions,
                   std::size_t first, std::size_t count);
// From now on it is in use, in place of the one before. Errors as above: the run may have changed meanwhile.
Result<void> complete_reference(SQLite::Database& database, std::int64_t reference, const std::string& reason,
                                const station::Author& by);
// not_found: the run has none.
Result<void> remove_reference(SQLite::Database& database, RunId run, const std::string& reason,
                              const station::Author& by);

// All of it at once, for a program that has the database to itself.
Result<OutsideReference> store_reference(SQLite::Database& database, const OutsideReference& reference,
                                         const OutsidePositions& positions, const std::string& reason,
                                         const station::Author& by);

// Those that were not completed, or this one of them, count as removed.
void remove_unfinished_references(SQLite::Database& database, std::optional<std::int64_t> only, std::int64_t utc_us);
// Deletes some positions that nobody can ask for any more; false: there were none.
bool delete_some_positions(SQLite::Database& database);

// A marker in a run: by its number, or the only one with this text. invalid: none, several, or nothing stored there.
struct MarkerPlace {
  std::uint32_t span = 0;
  std::uint64_t robot_time_us = 0;
};
Result<MarkerPlace> find_marker(SQLite::Database& database, RunId run, std::optional<std::int64_t> marker_id,
                                const std::string& marker_text);

// Where the robot set its position to 0 (zero_position) during a boot of the run, as its events say; perhaps before or
// after the run's samples.
struct Zeroing {
  std::uint32_t span = 0;
  std::uint64_t robot_time_us = 0;
};
std::vector<Zeroing> find_zeroings(SQLite::Database& database, RunId run);

}  // namespace server::storage
