// Delays repeated failed logins, by user and by address.
//
// After some failures each further attempt has to wait twice as long as the one before, up to a limit; a quarter of an
// hour without attempts forgets them. For a user the wait is short, since anyone can cause it; for an address it is
// long. Names and addresses fall into a fixed number of places, by a hash with a key that nobody knows: nothing grows,
// an unknown user is treated as a known one, and nobody can aim at another's place.
// SAFETY: it stands in front of passwords only. Who is signed in, a token and a one-time link never meet it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "server/config/endpoint.hpp"
#include "server/runtime/clock.hpp"

namespace server::identity {

class LoginThrottle {
 public:
  static constexpr std::size_t kPlaces = 4096;  // for users, and as many for addresses
  static constexpr int kFreeOfUser = 5;         // failures without a wait
  static constexpr int kFreeOfAddress = 10;
  static constexpr microseconds kLongestOfUser{std::chrono::seconds{30}};
  static constexpr microseconds kLongestOfAddress{std::chrono::minutes{15}};
  static constexpr microseconds kForgetAfter{std::chrono::minutes{15}};

  using Key = std::array<unsigned char, 16>;
  explicit LoginThrottle(const Key& key = random_key()) : key_{key} {}  // a test knows its key
  static Key random_key();

  // How long an attempt has to wait from `now_us` (steady); 0: not at all.
  microseconds wait(const std::string& user, const std::string& address, std::int64_t now_us) const;

  // Counts an attempt as a failure until on_success(). That forgets the user's failures; those of the address stay,
  // since the owner of one account may be guessing the password of another.
  void on_attempt(const std::string& user, const std::string& address, std::int64_t now_us);
  void on_success(const std::string& user, const std::string& address);

 private:
  struct Place {
    int failures = 0;
    std::int64_t last_us = 0;
    std::int64_t next_us = 0;  // the earliest next attempt
  };
  using Places = std::vector<Place>;

  std::size_t place_of(const std::string& name) const;
  static void add_failure(Place& place, int free, microseconds longest, std::int64_t now_us);

  Key key_;
  Places users_ = Places(kPlaces);
  Places addresses_ = Places(kPlaces);
};

}  // namespace server::identity
