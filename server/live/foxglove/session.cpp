// Channels come and go with robots, subscriptions with the client's messages.
#include "server/live/foxglove/session.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <ranges>

namespace server::live::foxglove {

void Session::begin(const std::string& station_name, const std::string& station_start) {
  queue_.push_lasting(server_facts_message(station_name, station_start));
  queue_.push_lasting(advertise_message({}));  // a client may wait for the first one, also where there is no robot
}

void Session::on_robot(const station::RobotState& robot) {
  if (only_ && *only_ != robot.id) return;
  const bool is_known = robots_.contains(robot.id);
  const bool is_wanted = robot.retired_at_us == 0;
  if (is_known && !is_wanted) unadvertise(robot.id);
  if (!is_known && is_wanted) advertise(robot.id);
}

void Session::advertise(const station::RobotId& robot) {
  if (robots_.size() == kMaxRobots) {
    if (std::exchange(has_said_full_, true)) return;
    return queue_.push_status(StatusLevel::warning,
                              fmt::format("only {} robots are shown; ask for a link of one robot to see another, such "
                                          "as {}",
                                          kMaxRobots, robot));
  }
  Channels& channels = robots_[robot];
  std::array<Channel, kTopics.size()> advertised;
  for (const Topic topic : kTopics) {
    const auto index = static_cast<std::size_t>(topic);
    const std::string prefix = only_ ? "" : "/" + robot;
    advertised[index] = {++last_channel_, prefix + name_of(topic), topic};
    channels[index].channel = advertised[index];
  }
  queue_.push_lasting(advertise_message(advertised));
}

void Session::unadvertise(const station::RobotId& robot) {
  const auto channels = robots_.extract(robot);
  std::vector<ChannelId> ids;
  for (const Subscribed& subscribed : channels.mapped()) {
    ids.push_back(subscribed.channel.id);
    if (subscribed.by) queue_.drop(*subscribed.by);
  }
  queue_.push_lasting(unadvertise_message(ids));
  has_said_full_ = false;
}

void Session::on_text(const std::string& text) {
  const auto message = parse_client_message(text);
  if (!message) return queue_.push_status(StatusLevel::error, message.error());
  std::visit([this](const auto& which) { act_on(which); }, *message);
}

void Session::on_binary(const std::string& bytes) { queue_.push_status(StatusLevel::error, refusal_of_binary(bytes)); }

void Session::act_on(const Subscribe& message) {
  for (const Subscribe::Entry& entry : message.subscriptions) {
    Subscribed* channel = find_channel(entry.channel);
    std::string refusal;
    if (channel == nullptr) {
      refusal = fmt::format("there is no channel {}", entry.channel);
    } else if (channel->by) {
      refusal = fmt::format("channel {} has the subscription {} already", entry.channel, *channel->by);
    } else if (find_subscription(entry.id) != nullptr) {
      refusal = fmt::format("the subscription id {} is in use", entry.id);
    }
    if (refusal.empty()) {
      channel->by = entry.id;
    } else {
      queue_.push_status(StatusLevel::error, "subscribe: " + refusal);
    }
  }
}

void Session::act_on(const Unsubscribe& message) {
  for (const SubscriptionId id : message.subscriptions) {
    Subscribed* subscribed = find_subscription(id);
    if (subscribed == nullptr) {
      queue_.push_status(StatusLevel::error, fmt::format("unsubscribe: there is no subscription {}", id));
      continue;
    }
    subscribed->by.reset();
    queue_.drop(id);
  }
}

Session::Subscribed* Session::find_channel(ChannelId id) {
  for (Channels& channels : std::views::values(robots_)) {
    for (Subscribed& subscribed : channels) {
      if (subscribed.channel.id == id) return &subscribed;
    }
  }
  return nullptr;
}

Session::Subscribed* Session::find_subscription(SubscriptionId id) {
  for (Channels& channels : std::views::values(robots_)) {
    for (Subscribed& subscribed : channels) {
      if (subscribed.by == id) return &subscribed;
    }
  }
  return nullptr;
}

std::optional<SubscriptionId> Session::subscription(const station::RobotId& robot, Topic topic) const {
  const auto channels = robots_.find(robot);
  if (channels == robots_.end()) return std::nullopt;
  return channels->second[static_cast<std::size_t>(topic)].by;
}

bool Session::is_subscribed(const station::RobotId& robot) const {
  const auto channels = robots_.find(robot);
  if (channels == robots_.end()) return false;
  return std::ranges::any_of(channels->second, [](const Subscribed& one) { return one.by.has_value(); });
}

}  // namespace server::live::foxglove
