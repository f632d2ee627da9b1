// The queue of one subscriber: its unread messages, bounded however slowly it reads.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <string>

#include "server/runtime/clock.hpp"
#include "server/station/state/station_state.hpp"

namespace server::live {

using LiveText = std::shared_ptr<const std::string>;

// One listener's queue. Of each robot at most one state waits: a newer one takes the place of the older, so a state is
// never dropped, and a slow reader gets the newest. Of everything else at most kMaxMessages and kMaxBytes wait: when
// it is full the oldest samples and stamps are dropped first, then the oldest of what is left, and the reader is
// notified how many by a `dropped` message.
class Subscriber {
 public:
  static constexpr std::size_t kMaxMessages = 256;
  static constexpr std::size_t kMaxBytes = 1024 * 1024;

  explicit Subscriber(boost::asio::io_context& loop) : arrived_{loop} {}

  void push(LiveText message, bool droppable);
  void push_state(const station::RobotId& robot, LiveText message);
  // Drops what waits of the robots whose ids follow the first of these, up to the second: a newer state was published.
  void forget_states(const station::RobotId& after, const station::RobotId& last);
  boost::asio::awaitable<void> wait();  // until a message waits; throws operation_aborted when cancelled
  LiveText pop();                       // null when none waits

  std::size_t size() const { return queue_.size() + states_.size(); }

 private:
  struct Entry {
    std::uint64_t number = 0;  // in order of arrival
    LiveText message;
    bool droppable = false;
  };
  struct Slot {
    std::uint64_t number = 0;
    station::RobotId robot;
  };

  void drop_one();
  bool state_is_next() const;
  LiveText pop_state();

  std::deque<Entry> queue_;  // but for states
  std::size_t queued_bytes_ = 0;
  std::deque<Slot> slots_;                       // the robots whose states wait
  std::map<station::RobotId, LiveText> states_;  // the newest of each
  bool state_was_last_ = false;
  std::uint64_t pushed_ = 0;
  std::uint64_t dropped_ = 0;
  runtime::Signal arrived_;
};

}  // namespace server::live
