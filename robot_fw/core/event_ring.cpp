// Keeps events in a ring.
#include "robot_fw/core/event_ring.hpp"

#include <algorithm>

namespace robot_fw {
namespace {

constexpr std::uint64_t kLow40 = (1ULL << 40) - 1;
constexpr std::uint64_t kLow48 = (1ULL << 48) - 1;

}  // namespace

void EventRing::push(const protocol::Event& event) {
  if (next_seq_ - oldest_seq_ == kCapacity) {
    ++oldest_seq_;
    ++lost_;
  }
  Record& record = records_[next_seq_++ % kCapacity];
  record.robot_time_us = event.event_robot_time_us & kLow48;
  record.kind = static_cast<std::uint8_t>(event.kind);
  record.cause = static_cast<std::uint8_t>(event.cause);
  record.sample_seq = event.sample_seq & kLow40;
  record.mode = static_cast<std::uint8_t>(event.mode);
  record.sub_state = static_cast<std::uint8_t>(event.sub_state);
  record.emergency_cause = static_cast<std::uint8_t>(event.emergency_cause);
  record.emergency_id = event.emergency_id;
  record.command_id = event.command_id;
  record.position_m = event.position_m;
  record.value = event.value;
}

void EventRing::acknowledge(std::uint64_t next_event_seq) {
  if (next_event_seq > next_seq_) return;
  acknowledged_next_seq_ = std::max(acknowledged_next_seq_, next_event_seq);
  oldest_seq_ = std::max(oldest_seq_, next_event_seq);
}

protocol::Event EventRing::at(std::uint64_t event_seq) const {
  const Record& record = records_[event_seq % kCapacity];
  protocol::Event event = rheonaut_Event_init_zero;
  event.event_seq = event_seq;
  event.event_robot_time_us = record.robot_time_us;
  event.oldest_event_seq = oldest_seq_;
  event.kind = static_cast<protocol::EventKind>(record.kind);
  event.cause = static_cast<protocol::EventCause>(record.cause);
  event.sample_seq = record.sample_seq;
  event.mode = static_cast<protocol::Mode>(record.mode);
  event.sub_state = static_cast<protocol::SubState>(record.sub_state);
  event.position_m = record.position_m;
  event.value = record.value;
  event.emergency_id = record.emergency_id;
  event.command_id = record.command_id;
  event.emergency_cause = static_cast<protocol::EmergencyCause>(record.emergency_cause);
  return event;
}

}  // namespace robot_fw
