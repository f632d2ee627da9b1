// Queues messages, and drops the oldest when nobody reads.
#include "server/live/subscriber.hpp"

#include <algorithm>
#include <utility>

#include "server/live/state_json.hpp"

namespace server::live {
namespace asio = boost::asio;
using nlohmann::json;

void Subscriber::push(LiveText message, bool droppable) {
  queued_bytes_ += message->size();
  queue_.push_back({++pushed_, std::move(message), droppable});
  while (queue_.size() > kMaxMessages || (queued_bytes_ > kMaxBytes && queue_.size() > 1)) drop_one();
  arrived_.notify();
}

void Subscriber::push_state(const station::RobotId& robot, LiveText message) {
  const bool is_first = states_.insert_or_assign(robot, std::move(message)).second;
  if (is_first) slots_.push_back({++pushed_, robot});
  arrived_.notify();
}

void Subscriber::forget_states(const station::RobotId& after, const station::RobotId& last) {
  std::erase_if(slots_, [&](const Slot& slot) { return after < slot.robot && slot.robot <= last; });
  std::erase_if(states_, [&](const auto& state) { return after < state.first && state.first <= last; });
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

}  // namespace server::live
