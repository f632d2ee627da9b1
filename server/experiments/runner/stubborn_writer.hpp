// Changes of the database that must not be lost: each is tried again every second until it is on disk.
//
// Loop thread; SQL on the disk thread. Clock and recorder outlive it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <functional>
#include <string>

#include "server/runtime/clock.hpp"
#include "server/storage/ingest/recorder.hpp"

namespace server::experiments {

class StubbornWriter {
 public:
  StubbornWriter(runtime::Clock& clock, storage::Recorder& recorder) : clock_{clock}, recorder_{recorder} {}

  // `what` names it in the log.
  boost::asio::awaitable<void> keep(std::string what, std::function<void(storage::Database&)> change);

 private:
  runtime::Clock& clock_;
  storage::Recorder& recorder_;
};

}  // namespace server::experiments
