// A thread for blocking work: jobs and their results are passed as values.
//
//   auto job = [path] { return count_rows(path); };   // named, owns copies of all it uses
//   const int rows = co_await disk.run(std::move(job));
//
// An exception of the job is rethrown in the waiting coroutine. Cancelling the coroutine does not cancel a job that has
// begun: the wait ends when the job ends, so a job must be short or watch a stop token of its own. The worker outlives
// the loop's run(); its destructor joins the thread. Declare it after the loop: its thread may touch the loop for a
// moment after a result has arrived.
#pragma once

#include <atomic>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/cancellation_type.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/error.hpp>
#include <boost/asio/this_coro.hpp>
#include <boost/asio/thread_pool.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/system/system_error.hpp>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>

namespace server::runtime {

// How many coroutines are inside some piece of work: each counts itself.
template <class Number>
class Counted {
 public:
  explicit Counted(Number& count) : count_{count} { ++count_; }
  ~Counted() { --count_; }
  Counted(const Counted&) = delete;
  Counted& operator=(const Counted&) = delete;

 private:
  Number& count_;
};

class WorkerThread {
 public:
  // `niceness` is added to the thread's nice value (0 to 19).
  explicit WorkerThread(std::string name, int niceness = 0);
  ~WorkerThread();
  WorkerThread(const WorkerThread&) = delete;
  WorkerThread& operator=(const WorkerThread&) = delete;

  // Call from the loop's thread.
  template <class Job>
  boost::asio::awaitable<std::invoke_result_t<Job>> run(Job job) {
    const Counted pending{jobs_};
    using Value = std::invoke_result_t<Job>;
    const boost::asio::cancellation_slot not_cancellable;
    co_return co_await boost::asio::co_spawn(
        pool_, invoke<Value, Job>(std::move(job)),
        boost::asio::bind_cancellation_slot(not_cancellable, boost::asio::use_awaitable));
  }

  // The same for a job that only its caller needs: where that is cancelled before the job's turn, the job is left out,
  // and boost::system::system_error{operation_aborted} is thrown.
  // SAFETY: clients that ask and go, faster than this thread answers, keep no place of a port until their turn.
  template <class Job>
  boost::asio::awaitable<std::invoke_result_t<Job>> run_unless_cancelled(Job job) {
    const auto is_cancelled = std::make_shared<std::atomic<bool>>(false);
    auto slot = (co_await boost::asio::this_coro::cancellation_state).slot();
    if (slot.is_connected()) slot.assign([is_cancelled](boost::asio::cancellation_type) { *is_cancelled = true; });
    auto wanted = [is_cancelled, job = std::move(job)]() mutable {
      if (*is_cancelled) throw boost::system::system_error{boost::asio::error::operation_aborted};
      return job();
    };
    co_return co_await run(std::move(wanted));
  }

  // Jobs that were started and whose result has not reached its coroutine. Loop thread only.
  int jobs() const { return jobs_; }

 private:
  template <class Value, class Job>
  static boost::asio::awaitable<Value> invoke(Job job) {
    co_return job();
  }

  int jobs_ = 0;
  boost::asio::thread_pool pool_{1};
};

}  // namespace server::runtime
