// Writes what the station says and fans it out.
#include "server/live/live_feed.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

#include "server/live/state_json.hpp"

namespace server {
namespace asio = boost::asio;
using nlohmann::json;

namespace {
constexpr std::chrono::milliseconds kStampInterval{100};
}

void Subscriber::push(LiveText message, bool droppable) {
  queued_bytes_ += message->size();
  queue_.push_back({std::move(message), droppable});
  while (queue_.size() > kMaxMessages || (queued_bytes_ > kMaxBytes && queue_.size() > 1)) drop_one();
  arrived_.notify();
}

void Subscriber::drop_one() {
  auto victim = std::ranges::find_if(queue_, [](const Entry& entry) { return entry.droppable; });
  if (victim == queue_.end()) victim = queue_.begin();
  queued_bytes_ -= victim->message->size();
  queue_.erase(victim);
  ++dropped_;
}

asio::awaitable<void> Subscriber::wait() {
  while (queue_.empty()) co_await arrived_.wait();
}

LiveText Subscriber::pop() {
  if (dropped_ > 0) {
    const json notice{{"type", "dropped"}, {"count", std::exchange(dropped_, 0)}};
    return std::make_shared<const std::string>(dump(notice));
  }
  if (queue_.empty()) return nullptr;
  LiveText message = std::move(queue_.front().message);
  queue_.pop_front();
  queued_bytes_ -= message->size();
  return message;
}

// While nobody listens nothing is kept up; whoever comes gets the state of the station first.
void LiveFeed::add(Subscriber& subscriber) {
  if (subscribers_.empty()) {
    headlines_.clear();
    changed_.clear();
  }
  subscribers_.push_back(&subscriber);
}

asio::awaitable<void> LiveFeed::run() {
  for (;;) {
    co_await clock_.sleep_for(kStampInterval);
    if (subscribers_.empty()) continue;
    const auto changed = std::exchange(changed_, {});
    for (const auto& [id, robot] : changed) publish_robot(robot);
    publish(dump({{"type", "stamp"}, {"stamp_us", clock_.steady_us()}}), true);
  }
}

void LiveFeed::publish(std::string message, bool droppable) {
  const auto shared = std::make_shared<const std::string>(std::move(message));
  for (Subscriber* subscriber : subscribers_) subscriber->push(shared, droppable);
}

bool LiveFeed::headline_changed(const RobotState& robot) {
  const Headline now{robot.link,
                     robot.boot_id,
                     robot.context.mode,
                     robot.context.sub_state,
                     robot.context.emergency_id,
                     robot.pending_stop.value_or(0)};
  Headline& before = headlines_[robot.id];
  if (now == before) return false;
  before = now;
  return true;
}

void LiveFeed::publish_robot(const RobotState& robot) {
  publish(dump({{"type", "robot"}, {"robot", to_json(robot)}}), false);
}

void LiveFeed::publish_run(json run) {
  if (!subscribers_.empty()) publish(dump({{"type", "run"}, {"run", std::move(run)}}), false);
}

void LiveFeed::on_robot(const RobotState& robot) {
  if (subscribers_.empty()) return;
  if (!headline_changed(robot)) {
    changed_.insert_or_assign(robot.id, robot);
    return;
  }
  changed_.erase(robot.id);
  publish_robot(robot);
}

void LiveFeed::on_samples(const RobotState& robot, const SampleBatch& batch) {
  if (subscribers_.empty()) return;
  if (headline_changed(robot)) {
    changed_.erase(robot.id);
    publish_robot(robot);
  } else if (const auto waiting = changed_.find(robot.id); waiting != changed_.end()) {
    waiting->second = robot;
  }
  publish(samples_message(batch), true);
}

void LiveFeed::on_event(const RobotState&, const RobotEvent& event) {
  if (!subscribers_.empty()) publish(dump({{"type", "event"}, {"event", to_json(event)}}), false);
}

void LiveFeed::on_command(const CommandRecord& record) {
  if (!subscribers_.empty()) publish(dump({{"type", "command"}, {"command", to_json(record)}}), false);
}

}  // namespace server
