// Keeps events in a ring.
#include "robot_fw/core/event_ring.hpp"

#include <algorithm>

namespace robot_fw {

void EventRing::push(protocol::Event event) {
  if (next_seq_ - oldest_seq_ == kCapacity) {
    ++oldest_seq_;
    ++lost_;
  }
  event.event_seq = next_seq_;
  events_[next_seq_ % kCapacity] = event;
  ++next_seq_;
}

void EventRing::acknowledge(std::uint64_t next_event_seq) {
  if (next_event_seq <= next_seq_) oldest_seq_ = std::max(oldest_seq_, next_event_seq);
}

protocol::Event EventRing::at(std::uint64_t event_seq) const {
  protocol::Event event = events_[event_seq % kCapacity];
  event.oldest_event_seq = oldest_seq_;
  return event;
}

}  // namespace robot_fw
