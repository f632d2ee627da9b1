// What a fleet needs of each robot: its turn, and the counts of its samples.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <chrono>
#include <cstdint>

#include "sim_robot/client/station_connection.hpp"

namespace sim_robot {

// Of one robot over all its boots, or in sum. Always: made = acknowledged + held + lost.
struct SampleCounts {
  std::uint64_t made = 0;
  std::uint64_t acknowledged = 0;  // the station has them on disk
  std::uint64_t held = 0;          // in the ring, waiting for that
  std::uint64_t lost = 0;          // given up before that
  std::uint64_t gaps = 0;          // runs of lost samples
  std::uint64_t sent = 0;          // also when sent again
  std::uint64_t resent = 0;        // of them, as backfill
  std::uint64_t commands = 0;
  std::uint64_t missed_ticks = 0;
};

class FleetMember {
 public:
  using Clock = std::chrono::steady_clock;

  FleetMember() = default;
  FleetMember(const FleetMember&) = delete;
  FleetMember& operator=(const FleetMember&) = delete;
  virtual ~FleetMember() = default;

  // Robot time 0 is at `at`, which is not later than now.
  virtual void boot(Clock::time_point at) = 0;
  // Makes the samples that are due, and closes a silent connection. True when there is something to send.
  virtual bool tick() = 0;
  // Prefetches the memory of the next tick.
  virtual void prefetch() const {}
  // Sends without waiting.
  virtual void send() = 0;
  virtual Clock::time_point next_tick_at() const = 0;
  // Never returns but by cancellation.
  virtual boost::asio::awaitable<void> stay_connected() = 0;

  virtual SampleCounts samples() const = 0;
  virtual const StationConnection& connection() const = 0;
};

}  // namespace sim_robot
