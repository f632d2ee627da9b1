// Schedules coroutines with work of the same kind (writing to pages): a few run between two polls of all sockets.
//
// Without it the loop would serve all pages, often for milliseconds, before it reads a person's request, and again at
// each further step of that request. Loop thread; outlives the waiting coroutines.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <deque>
#include <functional>

namespace server::runtime {

class Turns {
 public:
  Turns(boost::asio::io_context& loop, int at_once) : loop_{loop}, at_once_{at_once} {}
  Turns(const Turns&) = delete;
  Turns& operator=(const Turns&) = delete;

  // True: it is the caller's turn at once. False: wait() for it.
  bool take();
  boost::asio::awaitable<void> wait();

  std::size_t waiting() const { return waiting_.size(); }

 private:
  void begin_round();
  void next_round();

  boost::asio::io_context& loop_;
  int at_once_;
  std::deque<std::move_only_function<void()>> waiting_;  // at most one of each
  int taken_ = 0;                                        // in this round
  bool is_round_ = false;  // next_round() is under way, behind everything that is ready now
};

}  // namespace server::runtime
