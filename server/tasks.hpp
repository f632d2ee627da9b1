// The long-lasting coroutines of the station: named, started in one place, stopped together.
//
// Loop thread only. Outlives every coroutine it started: the loop's run() returns when all have ended.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/cancellation_signal.hpp>
#include <boost/asio/io_context.hpp>
#include <list>
#include <string>

namespace server {

class TaskGroup {
 public:
  explicit TaskGroup(boost::asio::io_context& loop) : loop_{loop} {}

  // Starts a task. One that throws anything but operation_aborted is logged with its name, stops the group and makes
  // exit_code() 1: the service manager then restarts the station. After stop() nothing starts any more.
  void spawn(std::string name, boost::asio::awaitable<void> task);

  // Cancels every task; each ends at its next wait.
  void stop();

  bool stopping() const { return stopping_; }
  int exit_code() const { return exit_code_; }

 private:
  void ended(const std::string& name, std::exception_ptr failure);

  boost::asio::io_context& loop_;
  std::list<boost::asio::cancellation_signal> signals_;
  bool stopping_ = false;
  int exit_code_ = 0;
};

}  // namespace server
