// Writes what the station says and fans it out.
#include "server/live/live_feed.hpp"

#include <algorithm>
#include <boost/asio/post.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <chrono>
#include <utility>

#include "server/live/state_json.hpp"

namespace server {
namespace asio = boost::asio;
using nlohmann::json;

namespace {
constexpr std::chrono::milliseconds kStampInterval{100};
constexpr std::size_t kRobotsInATurn = 16;  // of the loop; each takes some 20 us
}  // namespace

void Subscriber::push(LiveText message, bool droppable) {
  queued_bytes_ += message->size();
  queue_.push_back({++pushed_, std::move(message), droppable});
  while (queue_.size() > kMaxMessages || (queued_bytes_ > kMaxBytes && queue_.size() > 1)) drop_one();
  arrived_.notify();
}

void Subscriber::push_state(const RobotId& robot, LiveText message) {
  const bool is_first = states_.insert_or_assign(robot, std::move(message)).second;
  if (is_first) slots_.push_back({++pushed_, robot});
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
  while (size() == 0) co_await arrived_.wait();
}

// In order of arrival, but never two states on end while something else waits: the states of a large fleet would leave
// a slow reader nothing else.
bool Subscriber::state_is_next() const {
  if (slots_.empty()) return false;
  return queue_.empty() || (!state_was_last_ && slots_.front().number < queue_.front().number);
}

LiveText Subscriber::pop_state() {
  const auto state = states_.find(slots_.front().robot);
  LiveText message = std::move(state->second);
  states_.erase(state);
  slots_.pop_front();
  return message;
}

LiveText Subscriber::pop() {
  if (dropped_ > 0) {
    const json notice{{"type", "dropped"}, {"count", std::exchange(dropped_, 0)}};
    return std::make_shared<const std::string>(dump(notice));
  }
  state_was_last_ = state_is_next();
  if (state_was_last_) return pop_state();
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
    co_await publish_changed();
    publish(dump({{"type", "stamp"}, {"stamp_us", clock_.steady_us()}}), true);
  }
}

// A few robots in each turn of the loop. Of those that change meanwhile, the ones that it has passed wait for the next
// stamp.
asio::awaitable<void> LiveFeed::publish_changed() {
  std::size_t published = 0;
  RobotId passed;
  for (auto next = changed_.begin(); next != changed_.end(); next = changed_.upper_bound(passed)) {
    publish_robot(next->second, false);
    passed = next->first;
    changed_.erase(next);
    if (++published % kRobotsInATurn == 0) co_await asio::post(asio::use_awaitable);
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

void LiveFeed::publish_robot(const RobotState& robot, bool is_headline) {
  LiveText message;  // written when the first is to hear it
  for (Subscriber* subscriber : subscribers_) {
    if (!is_headline && !subscriber->watches(robot.id)) continue;
    if (message == nullptr) {
      message = std::make_shared<const std::string>(dump({{"type", "robot"}, {"robot", to_json(robot)}}));
    }
    subscriber->push_state(robot.id, message);
  }
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
  publish_robot(robot, true);
}

void LiveFeed::on_samples(const RobotState& robot, const SampleBatch& batch) {
  if (subscribers_.empty()) return;
  if (headline_changed(robot)) {
    changed_.erase(robot.id);
    publish_robot(robot, true);
  } else if (const auto waiting = changed_.find(robot.id); waiting != changed_.end()) {
    waiting->second = robot;
  }
  LiveText message;  // written when the first has asked for it
  for (Subscriber* subscriber : subscribers_) {
    if (!subscriber->watches(robot.id)) continue;
    if (message == nullptr) message = std::make_shared<const std::string>(samples_message(batch));
    subscriber->push(message, true);
  }
}

void LiveFeed::on_event(const RobotState&, const RobotEvent& event) {
  if (!subscribers_.empty()) publish(dump({{"type", "event"}, {"event", to_json(event)}}), false);
}

void LiveFeed::on_command(const CommandRecord& record) {
  if (!subscribers_.empty()) publish(dump({{"type", "command"}, {"command", to_json(record)}}), false);
}

}  // namespace server
