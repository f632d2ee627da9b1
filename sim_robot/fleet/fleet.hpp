// Many robots in one process and on one loop: a wheel gives each of them its turn once in a period.
//
//   turn k is at start + k · kSlotUs; robot i has the turns k ≡ i (mod slots), slots = period/kSlotUs               (1)
// One timer turns the wheel, whatever the number of robots. Robots boot and dial kBootEveryUs apart, each at a turn of
// its own slot: so neither their ticks nor their frames nor their dialling come all at once. A late turn is taken as
// soon as possible, and robots catch up by themselves; after a stall of over a period whole rounds are left out.
// In a turn all robots of the slot tick, then those with a frame send: a station that is woken by the first frame is
// still awake for the others, which halves the cost of a frame, and a robot's memory is touched once a tick.
// Owns the robots. One thread: that of `loop`, which must outlive the fleet and be stopped before it ends.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "sim_robot/client/fleet_member.hpp"
#include "sim_robot/client/lateness.hpp"

namespace sim_robot {

// Of all robots together.
struct FleetCounts {
  std::uint64_t robots = 0;
  std::uint64_t booted = 0;
  std::uint64_t connected = 0;  // TCP connections that are open now
  std::uint64_t welcomed = 0;   // robots that the station took in at least once
  std::uint64_t reconnects = 0;
  SampleCounts samples;
  LinkCounts links;
  std::string refusal;  // of one of those that were refused last, for people
};

class Fleet {
 public:
  using Members = std::vector<std::unique_ptr<FleetMember>>;
  static constexpr std::uint64_t kSlotUs = 2500;
  static constexpr std::uint64_t kBootEveryUs = 2000;

  // The period is at least kSlotUs.
  Fleet(boost::asio::io_context& loop, Members members, std::chrono::microseconds period);

  // Turns the wheel until cancelled.
  boost::asio::awaitable<void> run();

  FleetCounts counts() const;
  const Lateness& lateness() const { return lateness_; }
  std::size_t size() const { return members_.size(); }
  const FleetMember& robot(std::size_t i) const { return *members_[i]; }
  std::size_t slots() const { return slots_.size(); }

 private:
  using Clock = FleetMember::Clock;
  struct Slot {
    std::vector<FleetMember*> members;  // in the order in which they boot
    std::size_t booted = 0;
  };

  void take_turn(std::uint64_t turn);
  void count(Clock::duration late);
  void boot_due(Slot& slot, std::uint64_t turn);
  Clock::time_point time_of(std::uint64_t turn) const { return started_at_ + turn * slot_; }

  boost::asio::io_context& loop_;
  Members members_;
  std::vector<Slot> slots_;
  std::chrono::microseconds slot_{kSlotUs};
  Clock::time_point started_at_;
  std::vector<FleetMember*> with_frames_;  // of this turn
  Lateness lateness_;
};

}  // namespace sim_robot
