// The long-lasting coroutines of the station: named, started in one place, stopped together.
//
// Loop thread only. Outlives every coroutine it started: the loop's run() returns when all have ended.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/cancellation_signal.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <list>
#include <optional>
#include <string>

#include "server/runtime/exceptions.hpp"

namespace server::runtime {

class TaskGroup {
 public:
  explicit TaskGroup(boost::asio::io_context& loop) : loop_{loop}, stop_signals_{loop} {}

  // Starts a task. One that throws anything but operation_aborted is logged with its name, stops the group and makes
  // exit_code() 1: the service manager then restarts the station. After stop() nothing starts any more.
  void spawn(std::string name, boost::asio::awaitable<void> task);

  // Runs the loop until every task has ended, in turns that the clock's watch sees.
  void run(Clock& clock);

  // Cancels every task; each ends at its next wait.
  void stop();

  // A task that stops the group at SIGINT or SIGTERM. Those that come later are ignored, with one line: what was
  // received is still to reach the disk.
  boost::asio::awaitable<void> stop_on_signal();

  bool stopping() const { return stopping_; }
  int exit_code() const { return exit_code_; }

  // What ended by an exception and was no task of its own to stop the group.
  ExceptionLog& exceptions() { return exceptions_; }

 private:
  void ended(const std::string& name, std::exception_ptr failure);
  void ignore_later_signals(bool is_said);

  boost::asio::io_context& loop_;
  boost::asio::signal_set stop_signals_;  // SAFETY: none of them ends the program while it is there
  std::list<boost::asio::cancellation_signal> signals_;
  ExceptionLog exceptions_;
  bool stopping_ = false;
  int exit_code_ = 0;
};

// Runs the loop until this one coroutine has ended, and gives its result or its exception: for what must be done before
// the tasks start. Nothing else may be started on the loop yet.
template <class T>
T run_first(boost::asio::io_context& loop, boost::asio::awaitable<T> coroutine) {
  std::optional<T> result;
  std::exception_ptr failure;
  auto on_end = [&](std::exception_ptr error, T value) {
    failure = error;
    if (!error) result = std::move(value);
  };
  boost::asio::co_spawn(loop, std::move(coroutine), on_end);
  loop.run();
  loop.restart();
  if (failure) std::rethrow_exception(failure);
  return std::move(*result);
}

inline void run_first(boost::asio::io_context& loop, boost::asio::awaitable<void> coroutine) {
  std::exception_ptr failure;
  boost::asio::co_spawn(loop, std::move(coroutine), [&](std::exception_ptr error) { failure = error; });
  loop.run();
  loop.restart();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace server::runtime
