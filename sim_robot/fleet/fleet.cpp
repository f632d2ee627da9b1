// Turns the wheel and adds up.
#include "sim_robot/fleet/fleet.hpp"

#include <algorithm>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <utility>

namespace sim_robot {

namespace asio = boost::asio;

Fleet::Fleet(asio::io_context& loop, Members members, std::chrono::microseconds period)
    : loop_(loop),
      members_(std::move(members)),
      slots_(static_cast<std::size_t>(period / std::chrono::microseconds(kSlotUs))) {
  for (std::size_t i = 0; i < members_.size(); ++i) slots_[i % slots_.size()].members.push_back(members_[i].get());
}

asio::awaitable<void> Fleet::run() {
  asio::steady_timer timer{co_await asio::this_coro::executor};
  started_at_ = Clock::now();
  for (std::uint64_t turn = 0;; ++turn) {
    const auto now_turn = static_cast<std::uint64_t>((Clock::now() - started_at_) / slot_);
    if (now_turn > turn + slots_.size()) turn += (now_turn - turn) / slots_.size() * slots_.size();
    timer.expires_at(time_of(turn));
    co_await timer.async_wait(asio::use_awaitable);
    take_turn(turn);
  }
}

void Fleet::take_turn(std::uint64_t turn) {
  Slot& slot = slots_[turn % slots_.size()];
  boot_due(slot, turn);
  for (std::size_t i = 0; i < slot.booted; ++i) {
    FleetMember& member = *slot.members[i];
    if (i + 1 < slot.booted) slot.members[i + 1]->prefetch();
    const Clock::duration late = Clock::now() - member.next_tick_at();
    count(late);
    if (late < Clock::duration::zero()) continue;  // it had its turn when bytes came
    if (member.tick()) with_frames_.push_back(&member);
  }
  for (FleetMember* member : with_frames_) member->send();
  with_frames_.clear();
}

// Each tick that is due counts by itself, also those that a robot makes up for or skips.
void Fleet::count(Clock::duration late) {
  constexpr int kMostTicks = 1000;
  const Clock::duration period = slots_.size() * slot_;
  for (int i = 0; i == 0 || (i < kMostTicks && late >= Clock::duration::zero()); ++i, late -= period) {
    lateness_.add(std::chrono::duration_cast<std::chrono::microseconds>(late).count());
  }
}

void Fleet::boot_due(Slot& slot, std::uint64_t turn) {
  const std::size_t number = turn % slots_.size();
  while (slot.booted < slot.members.size()) {
    const std::uint64_t index = slot.booted * slots_.size() + number;  // among all robots
    if (index * kBootEveryUs > turn * kSlotUs) return;
    FleetMember& member = *slot.members[slot.booted++];
    member.boot(time_of(turn));
    asio::co_spawn(loop_, member.stay_connected(), [](const std::exception_ptr& error) {
      if (error) std::rethrow_exception(error);
    });
  }
}

FleetCounts Fleet::counts() const {
  FleetCounts sum;
  sum.robots = members_.size();
  for (const Slot& slot : slots_) sum.booted += slot.booted;
  for (const auto& member : members_) {
    const SampleCounts samples = member->samples();
    sum.samples.made += samples.made;
    sum.samples.acknowledged += samples.acknowledged;
    sum.samples.held += samples.held;
    sum.samples.lost += samples.lost;
    sum.samples.gaps += samples.gaps;
    sum.samples.sent += samples.sent;
    sum.samples.resent += samples.resent;
    sum.samples.commands += samples.commands;
    sum.samples.missed_ticks += samples.missed_ticks;
    const LinkCounts& links = member->connection().counts();
    sum.connected += member->connection().is_open() ? 1 : 0;
    sum.welcomed += links.welcomes > 0 ? 1 : 0;
    sum.reconnects += links.welcomes > 1 ? links.welcomes - 1 : 0;
    sum.links.unreachable += links.unreachable;
    sum.links.opened += links.opened;
    if (sum.refusal.empty()) sum.refusal = member->connection().refusal();
    sum.links.welcomes += links.welcomes;
    sum.links.refusals += links.refusals;
    sum.links.frames += links.frames;
  }
  return sum;
}

}  // namespace sim_robot
