// The list is short: it is searched from end to end.
#include "server/identity/tickets.hpp"

#include <algorithm>
#include <utility>

#include "server/identity/auth.hpp"

namespace server::identity {

std::string Tickets::issue(Caller maker) {
  make_room(maker.actor);
  std::string secret = runtime::random_secret();
  maker.scopes = Scopes{}.add(Scope::read);
  tickets_.push_back({runtime::hash_of(secret), clock_.steady_us() + kTicketValidity.count(), std::move(maker)});
  return secret;
}

std::optional<Caller> Tickets::redeem(const std::string& secret) {
  const bool is_good = holds(secret);
  const Ticket* found = runtime::find_secret(tickets_, runtime::hash_of(secret));
  if (found == nullptr) return std::nullopt;
  std::optional<Caller> maker = is_good ? std::optional{found->maker} : std::nullopt;
  tickets_.remove_if([found](const Ticket& each) { return &each == found; });
  return maker;
}

bool Tickets::holds(const std::string& secret) const {
  const Ticket* found = runtime::find_secret(tickets_, runtime::hash_of(secret));
  return found != nullptr && found->ends_at_us > clock_.steady_us() && still_stands(found->maker);
}

void Tickets::make_room(const std::string& actor) {
  std::erase_if(tickets_, [now_us = clock_.steady_us()](const Ticket& ticket) { return ticket.ends_at_us <= now_us; });
  const auto is_own = [&actor](const Ticket& ticket) { return ticket.maker.actor == actor; };
  if (std::ranges::count_if(tickets_, is_own) >= static_cast<std::ptrdiff_t>(kMaxTicketsOfOne)) {
    tickets_.erase(std::ranges::find_if(tickets_, is_own));
  }
  if (tickets_.size() >= kMaxTickets) tickets_.pop_front();
}

}  // namespace server::identity
