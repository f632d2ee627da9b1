// One Foxglove client without its socket: the channels it knows, what it has subscribed to, what waits for it.
//
// A session of one robot has the topics of an MCAP file, "/telemetry"; one of all robots has the robot before them,
// "/sim-1/telemetry", for the first kMaxRobots that it hears of. Ids of channels are its own and never used again.
// Loop thread.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "server/live/foxglove/outgoing_queue.hpp"

namespace server::live::foxglove {

class Session {
 public:
  static constexpr std::size_t kMaxRobots = 16;  // for each sample is a message of its own

  // `only`: the robot whose topics it has; none: all robots.
  Session(boost::asio::io_context& loop, runtime::Clock& clock, std::optional<station::RobotId> only)
      : only_{std::move(only)}, queue_{loop, clock} {}

  // The first message; the channels follow.
  void begin(const std::string& station_name, const std::string& station_start);

  // Its channels appear, unless they are there, and disappear when it is retired.
  void on_robot(const station::RobotState& robot);

  // What the client has sent. What cannot be acted on is answered with a status, and changes nothing.
  void on_text(const std::string& text);
  void on_binary(const std::string& bytes);

  // None: it has not subscribed.
  std::optional<SubscriptionId> subscription(const station::RobotId& robot, Topic topic) const;
  bool is_subscribed(const station::RobotId& robot) const;  // to one of its topics

  OutgoingQueue& queue() { return queue_; }

 private:
  struct Subscribed {
    Channel channel;
    std::optional<SubscriptionId> by;
  };
  using Channels = std::array<Subscribed, kTopics.size()>;

  void advertise(const station::RobotId& robot);
  void unadvertise(const station::RobotId& robot);
  void act_on(const Subscribe& message);
  void act_on(const Unsubscribe& message);
  Subscribed* find_channel(ChannelId id);
  Subscribed* find_subscription(SubscriptionId id);

  std::optional<station::RobotId> only_;
  std::map<station::RobotId, Channels> robots_;
  ChannelId last_channel_ = 0;
  bool has_said_full_ = false;
  OutgoingQueue queue_;
};

}  // namespace server::live::foxglove
