// DELETE by row numbers and by the segments' index; one gap row for each piece that was whole.
#include "server/recording/purge.hpp"

#include "server/recording/statement.hpp"

namespace server {
namespace {

class RetentionGaps {
 public:
  explicit RetentionGaps(SQLite::Database& database)
      : before_{database,
                "SELECT first_seq FROM gap WHERE boot_key = ?1 AND cause = 'retention' AND last_seq = ?2 - 1"
                " AND first_seq = (SELECT max(first_seq) FROM gap WHERE boot_key = ?1 AND first_seq < ?2)"},
        after_{database, "SELECT last_seq FROM gap WHERE boot_key = ? AND first_seq = ? AND cause = 'retention'"},
        remove_{database, "DELETE FROM gap WHERE boot_key = ? AND first_seq = ?"},
        add_{database,
             "INSERT INTO gap (boot_key, first_seq, last_seq, cause, noticed_at_us) VALUES (?, ?, ?, 'retention', ?)"} {
  }

  void add(std::int64_t boot_key, Interval purged, std::int64_t utc_us) {
    bind_all(after_, boot_key, purged.next);
    if (after_.executeStep()) {
      execute(remove_, boot_key, purged.next);
      purged.next = unsigned_id(after_.getColumn(0)) + 1;
    }
    bind_all(before_, boot_key, purged.first);
    if (before_.executeStep()) {
      purged.first = unsigned_id(before_.getColumn(0));
      execute(remove_, boot_key, purged.first);
    }
    after_.reset();
    before_.reset();
    execute(add_, boot_key, purged.first, purged.next - 1, utc_us);
  }

 private:
  SQLite::Statement before_, after_, remove_, add_;
};

}  // namespace

void purge(SQLite::Database& database, const std::vector<StoredSegment>& segments, std::int64_t utc_us) {
  SQLite::Statement rows{database, "DELETE FROM sample WHERE row BETWEEN ? AND ?"};
  SQLite::Statement segment{database, "DELETE FROM segment WHERE boot_key = ? AND first_seq = ?"};
  RetentionGaps gaps{database};
  Interval whole;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const StoredSegment& gone = segments[i];
    execute(rows, gone.first_row, gone.last_row);
    execute(segment, gone.boot_key, gone.samples.first);
    const bool goes_on = i > 0 && segments[i - 1].boot_key == gone.boot_key && whole.next == gone.samples.first;
    whole = {goes_on ? whole.first : gone.samples.first, gone.samples.next};
    const bool next_goes_on = i + 1 < segments.size() && segments[i + 1].boot_key == gone.boot_key &&
                              segments[i + 1].samples.first == whole.next;
    if (!next_goes_on) gaps.add(gone.boot_key, whole, utc_us);
  }
}

}  // namespace server
