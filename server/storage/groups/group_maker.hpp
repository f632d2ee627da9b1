// Makes the groups of segments of all settled windows (segment_groups.hpp): of what is recorded a minute after it is
// settled at most, and of a database of an earlier version in the background, from its first boot on.
//
// Boots are found on a reader. Groups are made in steps of one transaction on the disk thread, each of which ends by
// the clock after some 10 ms; commits go in between, and at least half of the disk thread's time is theirs. Loop
// thread. What it is given outlives it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <cstdint>

#include "server/runtime/clock.hpp"
#include "server/storage/database/database_reader.hpp"
#include "server/storage/ingest/recorder.hpp"

namespace server::storage {

class GroupMaker {
 public:
  GroupMaker(runtime::Clock& clock, Recorder& recorder, DatabaseReader& reader)
      : clock_{clock}, recorder_{recorder}, reader_{reader} {}

  // A pass a minute, until cancelled. A disk that fails is tried again with the next one.
  boost::asio::awaitable<void> run();
  // Makes all that can be made now.
  boost::asio::awaitable<void> pass();

  std::int64_t longest_step_us() const { return longest_step_us_; }

 private:
  boost::asio::awaitable<void> make_groups(std::int64_t boot_key);

  runtime::Clock& clock_;
  Recorder& recorder_;
  DatabaseReader& reader_;
  std::int64_t longest_step_us_ = 0;
};

}  // namespace server::storage
