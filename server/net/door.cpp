// Counts guests, and picks who gives way.
#include "server/net/door.hpp"

#include <spdlog/spdlog.h>

#include "server/config/endpoint.hpp"

namespace server {
namespace {

// Who was ended and has not gone yet still holds a descriptor.
constexpr std::size_t kMaxLeaving = 64;

}  // namespace

Door::Guest::Guest(Door& door, const std::string& address)
    : door_{door}, address_{door.addresses_.try_emplace(address).first} {
  Guests& strangers = door_.guests_[stranger];
  place_ = strangers.insert(strangers.end(), this);
  ++address_->second.guests;
  count(1);
}

Door::Guest::~Guest() {
  count(-1);
  door_.guests_[state_].erase(place_);
  if (--address_->second.guests == 0) door_.addresses_.erase(address_);
}

// Adds it to the counts of its address, as what it is now, or takes it out of them.
void Door::Guest::count(int sign) const {
  if (state_ == leaving) return;
  const auto change = static_cast<std::size_t>(sign);  // of -1, too: it wraps round
  address_->second.here += change;
  if (state_ == stranger) address_->second.strangers += change;
}

void Door::Guest::becomes(State state) {
  if (state_ == leaving) return;
  count(-1);
  Guests& to = door_.guests_[state];
  to.splice(to.end(), door_.guests_[state_], place_);
  state_ = state;
  count(1);
}

std::size_t Door::connections() const {
  std::size_t count = 0;
  for (const Guests& guests : guests_) count += guests.size();
  return count;
}

bool Door::is_full() const {
  return connections() - guests_[Guest::leaving].size() >= limits_.connections ||
         guests_[Guest::stranger].size() >= limits_.strangers;
}

std::expected<std::unique_ptr<Guest>, Door::Refusal> Door::admit(const std::string& address, bool from_loopback) {
  const std::string network = network_of(address);
  const auto known = addresses_.find(network);
  const std::size_t here = known == addresses_.end() ? 0 : known->second.here;
  if (here >= (from_loopback ? limits_.of_loopback : limits_.of_address)) {
    if (!make_room(&network)) return refuse(address, Refusal::address_has_its_share);
  } else if (is_full() && !make_room(nullptr)) {
    return refuse(address, Refusal::full);
  }
  return std::make_unique<Guest>(*this, network);
}

// Of this address, or of whoever has most strangers.
bool Door::make_room(const std::string* address) {
  if (guests_[Guest::leaving].size() >= kMaxLeaving) return false;
  Guest* guest = first_of(Guest::stranger, address);
  if (guest == nullptr) guest = first_of(Guest::idle, address);
  if (guest == nullptr) return false;
  ++counters_.replaced;
  guest->becomes(Guest::leaving);
  guest->end_();
  return true;
}

Guest* Door::first_of(Guest::State state, const std::string* address) const {
  Guest* first = nullptr;
  for (Guest* guest : guests_[state]) {
    if (address != nullptr) {
      if (guest->address_->first == *address) return guest;
    } else if (first == nullptr || guest->address_->second.strangers > first->address_->second.strangers) {
      first = guest;
    }
  }
  return first;
}

std::unexpected<Door::Refusal> Door::refuse(const std::string& address, Refusal why) {
  ++counters_.refused;
  if (const auto unsaid = lines_.next(clock_.steady_us())) {
    spdlog::warn("{}: {} refused, {}; {} connections are open{}", port_, address,
                 why == Refusal::full ? "all places are taken" : "its address has its share", connections(),
                 and_before(*unsaid));
  }
  return std::unexpected{why};
}

}  // namespace server
