// The rows of a table as messages in JSON: a member for each column that has a value, under its name.
//
// Integers and texts as they are. A number that is exactly a binary32, as all of a robot are, is the shortest decimal
// that gives this binary32 back (0.9), any other one the shortest that gives the same binary64 back. On the thread that
// owns the handle; throws when the disk does not take it.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include "server/storage/export/mcap/mcap_file.hpp"

namespace server::storage {

struct TableChannel {
  const char* topic;
  const char* schema_name;
  const char* table;
  const char* log_time_us;      // an expression over the columns
  const char* publish_time_us;  // the same
};

class TableMessages {
 public:
  // Adds the channel. Both outlive this.
  TableMessages(SQLite::Database& database, McapFile& file, const TableChannel& what);

  // Some rows more; false when all are there.
  bool advance();

 private:
  McapFile& file_;
  SQLite::Statement rows_;
  ChannelId channel_;
  std::uint32_t sequence_ = 0;
};

// Before 1970 there is no time.
inline std::uint64_t nanoseconds(std::int64_t time_us) {
  return time_us < 0 ? 0 : static_cast<std::uint64_t>(time_us) * 1000;
}

}  // namespace server::storage
