// The last 16 events, kept until the station has them on disk.
#pragma once

#include <array>
#include <cstdint>

#include "protocol/messages.hpp"

namespace robot_fw {

class EventRing {
 public:
  static constexpr std::size_t kCapacity = 16;

  // Numbers the event and keeps it. A full ring drops its oldest event and counts it as lost.
  void push(const protocol::Event& event);
  // Forgets every event below `next_event_seq`; a number above next_seq() is ignored.
  void acknowledge(std::uint64_t next_event_seq);
  // The event with this number; it must lie in [oldest_seq(), next_seq()).
  protocol::Event at(std::uint64_t event_seq) const;

  std::uint64_t oldest_seq() const { return oldest_seq_; }
  std::uint64_t next_seq() const { return next_seq_; }
  // The highest number that was acknowledged.
  std::uint64_t acknowledged_next_seq() const { return acknowledged_next_seq_; }
  std::uint32_t lost() const { return lost_; }

 private:
  // An event without its number, which follows from its place. Every enumerator is below 256; 48 bits of microseconds
  // are 8 years, 40 bits of samples 348 years.
  struct Record {
    std::uint64_t robot_time_us : 48;
    std::uint64_t kind : 8;
    std::uint64_t cause : 8;
    std::uint64_t sample_seq : 40;
    std::uint64_t mode : 8;
    std::uint64_t sub_state : 8;
    std::uint64_t emergency_cause : 8;
    std::uint64_t emergency_id;
    std::uint64_t command_id;
    float position_m;
    float value;
  };
  static_assert(sizeof(Record) == 40, "an event outgrew its place");

  std::array<Record, kCapacity> records_{};
  std::uint64_t oldest_seq_ = 0;
  std::uint64_t next_seq_ = 0;
  std::uint64_t acknowledged_next_seq_ = 0;
  std::uint32_t lost_ = 0;
};

}  // namespace robot_fw
