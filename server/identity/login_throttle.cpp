// Two tables of fixed size, keyed by SipHash.
#include "server/identity/login_throttle.hpp"

#include <sodium.h>

#include <algorithm>
#include <cstring>
#include <stdexcept>

namespace server::identity {

LoginThrottle::Key LoginThrottle::random_key() {
  static_assert(sizeof(Key) == crypto_shorthash_KEYBYTES);
  if (sodium_init() < 0) throw std::runtime_error{"libsodium cannot start: no source of random numbers"};
  Key key;
  crypto_shorthash_keygen(key.data());
  return key;
}

std::size_t LoginThrottle::place_of(const std::string& name) const {
  std::array<unsigned char, crypto_shorthash_BYTES> hash{};
  crypto_shorthash(hash.data(), reinterpret_cast<const unsigned char*>(name.data()), name.size(), key_.data());
  std::uint64_t number = 0;
  std::memcpy(&number, hash.data(), sizeof number);
  return number % kPlaces;
}

microseconds LoginThrottle::wait(const std::string& user, const std::string& address, std::int64_t now_us) const {
  const std::int64_t next_us =
      std::max(users_[place_of(user)].next_us, addresses_[place_of(config::network_of(address))].next_us);
  return microseconds{std::max<std::int64_t>(0, next_us - now_us)};
}

void LoginThrottle::add_failure(Place& place, int free, microseconds longest, std::int64_t now_us) {
  if (now_us - place.last_us >= kForgetAfter.count()) place = {};
  ++place.failures;
  place.last_us = now_us;
  const int beyond = place.failures - free;
  if (beyond < 0) return;
  constexpr int kMostDoublings = 20;
  const std::int64_t delay_us = std::int64_t{1'000'000} << std::min(beyond, kMostDoublings);
  place.next_us = now_us + std::min(delay_us, longest.count());
}

void LoginThrottle::on_attempt(const std::string& user, const std::string& address, std::int64_t now_us) {
  add_failure(users_[place_of(user)], kFreeOfUser, kLongestOfUser, now_us);
  add_failure(addresses_[place_of(config::network_of(address))], kFreeOfAddress, kLongestOfAddress, now_us);
}

void LoginThrottle::on_success(const std::string& user, const std::string& address) {
  users_[place_of(user)] = {};
  Place& place = addresses_[place_of(config::network_of(address))];
  place.failures = std::max(0, place.failures - 1);
  if (place.failures < kFreeOfAddress) place.next_us = 0;
}

}  // namespace server::identity
