// Coroutines that wait until what was enqueued before them is durable, and the wait of the run loop for such a one.
//
// Loop thread; owned by the Recorder. Loop and clock outlive it. A coroutine that is cancelled or gives up after 3 s is
// dropped when the next one comes, or when its commit is durable.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "server/runtime/clock.hpp"

namespace server::storage {

class FlushWaiters {
 public:
  FlushWaiters(boost::asio::io_context& loop, runtime::Clock& clock) : loop_{loop}, clock_{clock}, wanted_{loop} {}

  bool empty() const { return waiters_.empty(); }
  std::size_t size() const { return waiters_.size(); }

  // True once all that was enqueued before is durable: the records with the next commit, and as many segments as
  // `position` says (CommitQueue). False after 3 s if it is not yet.
  boost::asio::awaitable<bool> wait_for(std::uint64_t position);

  // Returns when somebody waits, or at this steady time.
  boost::asio::awaitable<void> until_wanted(std::int64_t steady_us);

  // A commit was built: it has the records that anybody waits for.
  void on_commit_built();
  // The last commit is durable, and all up to this position.
  void on_durable(std::uint64_t position);

 private:
  struct Waiter {
    std::weak_ptr<runtime::Signal> done;
    std::uint64_t position = 0;
    bool is_in_commit = false;  // its records
  };

  boost::asio::io_context& loop_;
  runtime::Clock& clock_;
  runtime::Signal wanted_;
  std::vector<Waiter> waiters_;
};

}  // namespace server::storage
