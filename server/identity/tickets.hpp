// One-time tickets: what lets in a program that can send neither a header nor a cookie, only an address.
//
// A ticket is 256 random bits in the query of that address, and is worth less than other credentials, since addresses
// are seen and kept in more places: it works once, within kTicketValidity, for what this object stands in front of and
// nothing else, and may read alone, whatever its maker may. It ends with its maker's credential, as does what it has
// let in. In memory only, as a BLAKE2b hash, compared in constant time. Loop thread.
#pragma once

#include <list>
#include <optional>
#include <string>

#include "server/identity/caller.hpp"
#include "server/runtime/clock.hpp"
#include "server/runtime/secrets.hpp"

namespace server::identity {

inline constexpr microseconds kTicketValidity{std::chrono::minutes{2}};
inline constexpr std::size_t kMaxTicketsOfOne = 4;  // of an actor; one more takes the place of the oldest
inline constexpr std::size_t kMaxTickets = 256;     // of all; the same holds

class Tickets {
 public:
  explicit Tickets(runtime::Clock& clock) : clock_{clock} {}

  std::string issue(Caller maker);  // the secret of a new ticket

  // Its maker, who may read alone; none: the ticket is unknown, used, too old, or its maker's credential has ended.
  std::optional<Caller> redeem(const std::string& secret);

  bool holds(const std::string& secret) const;  // redeem() would give its maker

  std::size_t size() const { return tickets_.size(); }

 private:
  struct Ticket {
    runtime::SecretHash hash{};
    std::int64_t ends_at_us = 0;  // steady
    Caller maker;
  };

  void make_room(const std::string& actor);

  runtime::Clock& clock_;
  std::list<Ticket> tickets_;  // oldest first
};

}  // namespace server::identity
