// Counts slots, and picks who gives way.
#include "server/net/connection_limiter.hpp"

#include <spdlog/spdlog.h>

#include "server/config/endpoint.hpp"

namespace server::net {
namespace {

// Who was ended and has not gone yet still holds a descriptor.
constexpr std::size_t kMaxLeaving = 64;

}  // namespace

ConnectionLimiter::Slot::Slot(ConnectionLimiter& limiter, const std::string& address)
    : limiter_{limiter}, address_{limiter.addresses_.try_emplace(address).first} {
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

// Adds it to the counts of its address, as what it is now, or takes it out of them.
void ConnectionLimiter::Slot::count(int sign) const {
  if (state_ == leaving) return;
  const auto change = static_cast<std::size_t>(sign);  // of -1, too: it wraps round
  address_->second.here += change;
  if (state_ == unauthenticated) address_->second.unauthenticated += change;
}

void ConnectionLimiter::Slot::becomes(State state) {
  if (state_ == leaving) return;
  count(-1);
  Slots& to = limiter_.slots_[state];
  to.splice(to.end(), limiter_.slots_[state_], place_);
  state_ = state;
  count(1);
}

std::size_t ConnectionLimiter::connections() const {
  std::size_t count = 0;
  for (const Slots& slots : slots_) count += slots.size();
  return count;
}

bool ConnectionLimiter::is_full() const {
  return connections() - slots_[ConnectionSlot::leaving].size() >= limits_.connections ||
         slots_[ConnectionSlot::unauthenticated].size() >= limits_.unauthenticated;
}

std::expected<std::unique_ptr<ConnectionSlot>, ConnectionLimiter::Refusal> ConnectionLimiter::admit(
    const std::string& address, bool from_loopback) {
  const std::string network = config::network_of(address);
  const auto known = addresses_.find(network);
  const std::size_t here = known == addresses_.end() ? 0 : known->second.here;
  if (here >= (from_loopback ? limits_.of_loopback : limits_.of_address)) {
    if (!make_room(&network)) return refuse(address, Refusal::address_has_its_share);
  } else if (is_full() && !make_room(nullptr)) {
    return refuse(address, Refusal::full);
  }
  return std::make_unique<ConnectionSlot>(*this, network);
}

// Evicts one of this address, or (null) of the address with most unauthenticated connections.
bool ConnectionLimiter::make_room(const std::string* address) {
  if (slots_[ConnectionSlot::leaving].size() >= kMaxLeaving) return false;
  ConnectionSlot* slot = first_of(ConnectionSlot::unauthenticated, address);
  if (slot == nullptr) slot = first_of(ConnectionSlot::idle, address);
  if (slot == nullptr) return false;
  ++counters_.replaced;
  slot->becomes(ConnectionSlot::leaving);
  slot->end_();
  return true;
}

ConnectionSlot* ConnectionLimiter::first_of(ConnectionSlot::State state, const std::string* address) const {
  ConnectionSlot* first = nullptr;
  for (ConnectionSlot* slot : slots_[state]) {
    if (address != nullptr) {
      if (slot->address_->first == *address) return slot;
    } else if (first == nullptr || slot->address_->second.unauthenticated > first->address_->second.unauthenticated) {
      first = slot;
    }
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
