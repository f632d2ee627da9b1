// Counts slots, and picks who gives way.
#include "server/net/connection_limiter.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>

#include "server/config/endpoint.hpp"

namespace server::net {
namespace {

constexpr std::int64_t kSecondUs = 1'000'000;

}  // namespace

ConnectionLimiter::Slot::Slot(ConnectionLimiter& limiter, const std::string& address, bool is_reserve)
    : limiter_{limiter}, address_{limiter.addresses_.try_emplace(address).first}, is_reserve_{is_reserve} {
  Slots& newcomers = limiter_.slots_[unauthenticated];
  place_ = newcomers.insert(newcomers.end(), this);
  ++address_->second.slots;
  count(1);
}

ConnectionLimiter::Slot::~Slot() {
  count(-1);
  limiter_.slots_[state_].erase(place_);
  if (--address_->second.slots == 0) limiter_.addresses_.erase(address_);
}

// Adds it to the counts of its address, or takes it out of them.
void ConnectionLimiter::Slot::count(int sign) const {
  if (state_ == leaving) return;
  const auto change = static_cast<std::size_t>(sign);  // of -1, too: it wraps round
  Count& counts = address_->second;
  if (!is_reserve_) counts.here += change;
  if (state_ == unauthenticated && !is_reserve_) counts.unauthenticated += change;
  if (state_ != busy) (is_reserve_ ? counts.in_reserve : counts.yielding) += change;
}

void ConnectionLimiter::Slot::becomes(State state) {
  if (state_ == leaving) return;
  count(-1);
  Slots& to = limiter_.slots_[state];
  to.splice(to.end(), limiter_.slots_[state_], place_);
  if (state == sending) pace_ = {limiter_.clock_.steady_us() / kSecondUs, kSlowAnswer, 0};  // it has a second to begin
  state_ = state;
  count(1);
}

void ConnectionLimiter::Slot::Pace::turn(std::int64_t to) {
  if (to == second) return;
  last = to == second + 1 ? now : 0;
  now = 0;
  second = to;
}

void ConnectionLimiter::Slot::moved(std::size_t bytes) {
  pace_.turn(limiter_.clock_.steady_us() / kSecondUs);
  pace_.now += bytes;
}

std::size_t ConnectionLimiter::Slot::pace() const {
  Pace until_now = pace_;
  until_now.turn(limiter_.clock_.steady_us() / kSecondUs);
  return std::max(until_now.last, until_now.now);
}

std::size_t ConnectionLimiter::connections() const {
  std::size_t count = 0;
  for (const Slots& slots : slots_) count += slots.size();
  return count;
}

std::size_t ConnectionLimiter::unauthenticated() const {
  const Slots& slots = slots_[ConnectionSlot::unauthenticated];
  return static_cast<std::size_t>(std::ranges::count_if(slots, [](const Slot* slot) { return !slot->is_reserve_; }));
}

std::size_t ConnectionLimiter::in_reserve() const {
  std::size_t count = 0;
  for (const Slots& slots : slots_) {
    if (&slots == &slots_[ConnectionSlot::leaving]) continue;
    count += static_cast<std::size_t>(std::ranges::count_if(slots, [](const Slot* slot) { return slot->is_reserve_; }));
  }
  return count;
}

bool ConnectionLimiter::is_full() const {
  const std::size_t leaving = slots_[ConnectionSlot::leaving].size();
  return connections() - leaving - in_reserve() >= limits_.connections || unauthenticated() >= limits_.unauthenticated;
}

// SAFETY: those who show nothing keep nobody out who does. Null: no address has many of them.
ConnectionSlot* ConnectionLimiter::oldest_of_crowd() const {
  constexpr std::size_t kCrowd = 4;
  ConnectionSlot* first = nullptr;
  for (ConnectionSlot* slot : slots_[ConnectionSlot::unauthenticated]) {
    const std::size_t crowd = slot->is_reserve_ ? 0 : slot->address_->second.unauthenticated;
    if (crowd < kCrowd) continue;
    if (first == nullptr || crowd > first->address_->second.unauthenticated) first = slot;
  }
  return first;
}

bool ConnectionLimiter::give_up_one() {
  constexpr std::size_t kEnough = 8;  // descriptors that are about to come back
  return slots_[ConnectionSlot::leaving].size() >= kEnough || make_room(nullptr, false);
}

std::expected<std::unique_ptr<ConnectionSlot>, ConnectionLimiter::Refusal> ConnectionLimiter::admit(
    const std::string& address, bool from_loopback) {
  const std::string network = config::network_of(address);
  const auto known = addresses_.find(network);
  const std::size_t here = known == addresses_.end() ? 0 : known->second.here;
  const bool has_share = here >= (from_loopback ? limits_.of_loopback : limits_.of_address);
  const bool has_place = has_share ? make_room(&network, false) : !is_full() || make_room(nullptr, false);
  if (has_place) return std::make_unique<ConnectionSlot>(*this, network, false);
  if (in_reserve() < limits_.reserve || (limits_.reserve > 0 && make_room(nullptr, true)))
    return std::make_unique<ConnectionSlot>(*this, network, true);
  return refuse(address, has_share ? Refusal::address_has_its_share : Refusal::full);
}

// Evicts one of this address, or (null) of the address with most places of which one can go.
bool ConnectionLimiter::make_room(const std::string* address, bool is_reserve) {
  if (slots_[ConnectionSlot::leaving].size() >= kMaxLeaving) return false;
  ConnectionSlot* chosen = address == nullptr && !is_reserve ? oldest_of_crowd() : nullptr;
  if (chosen == nullptr) chosen = first_of_all(address, is_reserve);
  if (chosen == nullptr) return false;
  ++counters_.replaced;
  chosen->becomes(ConnectionSlot::leaving);
  chosen->end_();
  return true;
}

ConnectionSlot* ConnectionLimiter::first_of_all(const std::string* address, bool is_reserve) const {
  ConnectionSlot* chosen = nullptr;
  const auto places = [is_reserve](const ConnectionSlot& slot) {
    return is_reserve ? slot.address_->second.in_reserve : slot.address_->second.yielding;
  };
  for (const auto state :
       {ConnectionSlot::unauthenticated, ConnectionSlot::idle, ConnectionSlot::waiting, ConnectionSlot::sending}) {
    ConnectionSlot* slot = first_of(state, address, is_reserve);
    if (slot != nullptr && (chosen == nullptr || places(*slot) > places(*chosen))) chosen = slot;
  }
  return chosen;
}

// The first of this state that may go: of this address, or of the one with most places.
ConnectionSlot* ConnectionLimiter::first_of(ConnectionSlot::State state, const std::string* address,
                                            bool is_reserve) const {
  ConnectionSlot* first = nullptr;
  for (ConnectionSlot* slot : slots_[state]) {
    if (slot->is_reserve_ != is_reserve || (address != nullptr && slot->address_->first != *address)) continue;
    if (state == ConnectionSlot::sending && slot->pace() >= kSlowAnswer) continue;
    if (first == nullptr) first = slot;
    const ConnectionSlot::Count &its = slot->address_->second, &best = first->address_->second;
    const std::size_t here = is_reserve ? its.in_reserve : its.yielding;
    const std::size_t most = is_reserve ? best.in_reserve : best.yielding;
    const bool is_slower = state == ConnectionSlot::sending && here == most && slot->pace() < first->pace();
    if (here > most || is_slower) first = slot;
  }
  return first;
}

std::unexpected<ConnectionLimiter::Refusal> ConnectionLimiter::refuse(const std::string& address, Refusal why) {
  ++counters_.refused;
  if (const auto unsaid = lines_.next(clock_.steady_us())) {
    spdlog::warn("{}: {} refused, {}; {} connections are open{}", port_, address,
                 why == Refusal::full ? "all places are taken" : "its address has its share", connections(),
                 runtime::and_before(*unsaid));
  }
  return std::unexpected{why};
}

}  // namespace server::net
