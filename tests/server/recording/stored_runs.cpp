// Reads every row; the databases of these tests are small.
#include "tests/server/recording/stored_runs.hpp"

#include <fmt/format.h>

#include "server/storage/database/statement.hpp"
#include "server/storage/samples/interval_set.hpp"

namespace server {
namespace {

void add_rows(SQLite::Database& database, const std::string& sql,
              std::map<std::int64_t, std::vector<std::string>>& runs) {
  SQLite::Statement query{database, sql};
  while (query.executeStep()) {
    std::string row;
    for (int column = 0; column < query.getColumnCount(); ++column) row += query.getColumn(column).getString() + "|";
    runs[query.getColumn(0).getInt64()].push_back(row);
  }
}

}  // namespace

std::map<std::int64_t, std::vector<std::string>> stored_runs(SQLite::Database& database) {
  constexpr const char* kHeld = "WHERE run_id IN (SELECT run_id FROM run WHERE state <> 'discarded')";
  std::map<std::int64_t, std::vector<std::string>> runs;
  add_rows(database, fmt::format("SELECT * FROM run {} ORDER BY run_id", kHeld), runs);
  add_rows(database, fmt::format("SELECT * FROM run_sample {} ORDER BY run_id, span, seq", kHeld), runs);
  add_rows(database, fmt::format("SELECT * FROM run_gap {} ORDER BY run_id, span, first_seq", kHeld), runs);
  return runs;
}

std::vector<std::string> coverage_faults(SQLite::Database& database) {
  std::vector<std::string> faults;
  std::map<std::int64_t, storage::IntervalSet> covered;
  SQLite::Statement ranges{database,
                           "SELECT boot_key, first_seq, last_seq, 'segment' FROM segment"
                           " UNION ALL SELECT boot_key, first_seq, last_seq, cause FROM gap"};
  while (ranges.executeStep()) {
    const storage::Interval range{storage::unsigned_id(ranges.getColumn(1)),
                                  storage::unsigned_id(ranges.getColumn(2)) + 1};
    if (count(covered[ranges.getColumn(0).getInt64()].insert(range)) == range.next - range.first) continue;
    faults.push_back(fmt::format("boot {}: samples {} to {} ({}) twice", ranges.getColumn(0).getInt64(), range.first,
                                 range.next - 1, ranges.getColumn(3).getString()));
  }
  SQLite::Statement boots{database, "SELECT boot_key, durable_next_seq FROM boot"};
  while (boots.executeStep()) {
    const std::int64_t boot_key = boots.getColumn(0).getInt64();
    for (const storage::Interval& hole : covered[boot_key].missing({0, storage::unsigned_id(boots.getColumn(1))})) {
      faults.push_back(fmt::format("boot {}: samples {} to {} are nowhere", boot_key, hole.first, hole.next - 1));
    }
  }
  const auto number = [&](const char* sql) { return database.execAndGet(sql).getInt64(); };
  const std::int64_t samples = number("SELECT count(*) FROM sample");
  const std::int64_t in_segments = number("SELECT coalesce(sum(last_row - first_row + 1), 0) FROM segment");
  if (samples != in_segments) faults.push_back(fmt::format("{} rows, {} in segments", samples, in_segments));
  const std::int64_t linked = number("SELECT count(*) FROM segment JOIN sample ON row BETWEEN first_row AND last_row");
  if (linked != samples) faults.push_back(fmt::format("{} rows, {} of segments", samples, linked));
  return faults;
}

}  // namespace server
