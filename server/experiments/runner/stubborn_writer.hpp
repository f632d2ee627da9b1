// Changes of the database that must not be lost: each is tried again every second until it is on disk.
//
// They are stored in the order in which they were asked for: a later state of an experiment is never replaced by an
// earlier one that had to be tried again. Loop thread; SQL on the disk thread. Clock and recorder outlive it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <functional>
#include <set>
#include <string>

#include "server/runtime/clock.hpp"
#include "server/storage/ingest/recorder.hpp"

namespace server::experiments {

class StubbornWriter {
 public:
  StubbornWriter(boost::asio::io_context& loop, runtime::Clock& clock, storage::Recorder& recorder)
      : clock_{clock}, recorder_{recorder}, moved_{loop} {}

  // `what` names it in the log. Throws std::runtime_error for what no disk would take, such as a second row of one key.
  boost::asio::awaitable<void> keep(std::string what, std::function<void(storage::Database&)> change);

 private:
  class Turn;

  runtime::Clock& clock_;
  storage::Recorder& recorder_;
  std::set<std::uint64_t> turns_;  // of those that are not stored yet; the least is at it
  std::uint64_t next_turn_ = 0;
  runtime::Signal moved_;
};

}  // namespace server::experiments
