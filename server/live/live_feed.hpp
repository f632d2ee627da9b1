// What happens now, for everyone who watches: hears the station, writes each message once, and hands the same text to
// every subscriber.
//
// Loop thread. Outlives its subscribers. Never waits for anyone: a subscriber's queue is bounded (see Subscriber).
#pragma once

#include <boost/asio/awaitable.hpp>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "server/clock.hpp"
#include "server/station/station_sink.hpp"

namespace server {

using LiveText = std::shared_ptr<const std::string>;

// One listener's queue. Of each robot at most one state waits: a newer one takes the place of the older, so a state is
// never dropped, and whoever is slow hears the newest. Of everything else at most kMaxMessages and kMaxBytes wait: when
// it is full the oldest samples and stamps are dropped first, then the oldest of what is left, and the reader is told
// how many by a `dropped` message.
class Subscriber {
 public:
  static constexpr std::size_t kMaxMessages = 256;
  static constexpr std::size_t kMaxBytes = 1024 * 1024;

  explicit Subscriber(boost::asio::io_context& loop) : arrived_{loop} {}

  void push(LiveText message, bool droppable);
  void push_state(const RobotId& robot, LiveText message);
  boost::asio::awaitable<void> wait();  // until a message waits; throws operation_aborted when cancelled
  LiveText pop();                       // null when none waits

  // Of whose samples and small changes of state it hears from now on; before the first call, of all.
  void watch(std::set<RobotId> robots) { watched_ = std::move(robots); }
  bool watches(const RobotId& robot) const { return !watched_ || watched_->contains(robot); }

  std::size_t size() const { return queue_.size() + states_.size(); }

 private:
  struct Entry {
    std::uint64_t number = 0;  // in order of arrival
    LiveText message;
    bool droppable = false;
  };
  struct Slot {
    std::uint64_t number = 0;
    RobotId robot;
  };

  void drop_one();
  bool state_is_next() const;
  LiveText pop_state();

  std::deque<Entry> queue_;  // but for states
  std::size_t queued_bytes_ = 0;
  std::deque<Slot> slots_;              // the robots whose states wait
  std::map<RobotId, LiveText> states_;  // the newest of each
  bool state_was_last_ = false;
  std::uint64_t pushed_ = 0;
  std::uint64_t dropped_ = 0;
  std::optional<std::set<RobotId>> watched_;
  Signal arrived_;
};

class LiveFeed final : public StationSink {
 public:
  explicit LiveFeed(Clock& clock) : clock_{clock} {}

  // Every 100 ms: a stamp, and the robots whose state changed in small ways. Until cancelled.
  boost::asio::awaitable<void> run();

  void add(Subscriber& subscriber);
  void remove(Subscriber& subscriber) { std::erase(subscribers_, &subscriber); }

  void publish_run(nlohmann::json run);

  void on_robot(const RobotState& robot) override;
  void on_samples(const RobotState& robot, const SampleBatch& batch) override;
  void on_event(const RobotState& robot, const RobotEvent& event) override;
  void on_command(const CommandRecord& record) override;

 private:
  // What of a robot is told at once when it changes; everything else waits for the next stamp.
  using Headline = std::tuple<LinkState, BootId, protocol::Mode, protocol::SubState, std::uint64_t, CommandId>;

  boost::asio::awaitable<void> publish_changed();
  bool headline_changed(const RobotState& robot);
  void publish_robot(const RobotState& robot, bool is_headline);
  void publish(std::string message, bool droppable);

  Clock& clock_;
  std::vector<Subscriber*> subscribers_;
  std::map<RobotId, Headline> headlines_;
  std::map<RobotId, RobotState> changed_;  // since the last stamp
};

}  // namespace server
