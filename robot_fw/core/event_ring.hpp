// The last 32 events, kept until the station has them on disk.
#pragma once

#include <array>
#include <cstdint>

#include "protocol/messages.hpp"

namespace robot_fw {

class EventRing {
 public:
  static constexpr std::size_t kCapacity = 32;

  // Numbers the event and keeps it; the oldest one makes room and is counted as lost.
  void push(protocol::Event event);
  // Forgets every event below `next_event_seq`; a number above next_seq() is ignored.
  void acknowledge(std::uint64_t next_event_seq);
  // The event with this number; it must lie in [oldest_seq(), next_seq()).
  protocol::Event at(std::uint64_t event_seq) const;

  std::uint64_t oldest_seq() const { return oldest_seq_; }
  std::uint64_t next_seq() const { return next_seq_; }
  std::uint32_t lost() const { return lost_; }

 private:
  std::array<protocol::Event, kCapacity> events_{};
  std::uint64_t oldest_seq_ = 0;
  std::uint64_t next_seq_ = 0;
  std::uint32_t lost_ = 0;
};

}  // namespace robot_fw
