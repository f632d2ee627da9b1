// How rights end that accounts give, and who acts without one.
#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "server/identity/accounts.hpp"

namespace server::identity {
namespace asio = boost::asio;

namespace {

constexpr microseconds kLookInterval{std::chrono::seconds{1}};  // also at a clock that is set

}  // namespace

// SAFETY: no write to a slow or full disk is waited for.
asio::awaitable<void> Accounts::watch_rights() {
  for (;;) {
    end_expired();
    end_what_has_no_right();
    co_await clock_.sleep_until(next_look_us());
  }
}

void Accounts::end_expired() {
  for (Token& token : tokens_) {
    const bool has_ended = token.revoked_at_us != 0 || token.standing->ended();
    if (has_ended || !is_past(token)) continue;
    note_expiry(token);
    token.standing->end();
    end_right_of("token:" + token.name, fmt::format("token '{}' has expired", token.name));
  }
}

void Accounts::note_expiry(Token& token) {
  if (token.expired_at_us != 0) return;
  token.expired_at_us = clock_.utc_us();
  changed_.notify();
}

// SAFETY: what was seen to have expired does not hold again because the clock is set back.
bool Accounts::is_past(const ApiToken& token) const {
  return token.expired_at_us != 0 || (token.expires_at_us != 0 && token.expires_at_us <= clock_.utc_us());
}

// SAFETY: what a token moves ends when it expires, not up to a second later.
std::int64_t Accounts::next_look_us() const {
  const std::int64_t utc_us = clock_.utc_us();
  std::int64_t wait_us = kLookInterval.count();
  for (const Token& token : tokens_) {
    if (token.expires_at_us > utc_us) wait_us = std::min(wait_us, token.expires_at_us - utc_us);
  }
  return clock_.steady_us() + wait_us;
}

// Why the actor has not, or no longer, the scope; empty: it has it, or is only away.
std::string Accounts::lacks(const std::string& actor, Scope needed) const {
  constexpr std::string_view kUser = "user:", kToken = "token:";
  Scopes scopes = Scopes::of(Role::admin);
  std::string user;
  if (actor.starts_with(kToken) && actor != "token:local") {
    const auto found = std::ranges::find(tokens_, actor.substr(kToken.size()), &Token::name);
    if (found == tokens_.end() || found->revoked_at_us != 0) return actor + " was revoked";
    if (is_past(*found)) return actor + " has expired";
    scopes = found->scopes;
    user = found->owner;
  } else if (actor.starts_with(kUser)) {
    user = actor.substr(kUser.size(), actor.find('/') - kUser.size());
  }
  if (!user.empty()) {
    const User* known = find_user(user);
    if (known == nullptr || known->disabled) return fmt::format("user '{}' was removed or disabled", user);
    scopes = scopes & Scopes::of(known->role);
  }
  return scopes.allow(needed) ? "" : fmt::format("{} may not do that any more", actor);
}

// SAFETY: of a right that ended while the station was down, or while what it lets act was about to begin.
void Accounts::end_what_has_no_right() const {
  for (const Rights::Part& part : rights_.parts()) {
    for (const std::string& actor : part.acting()) {
      const std::string why = lacks(actor, part.needs);
      if (why.empty()) continue;
      Rights::end(part, {[&actor](const std::string& each) { return each == actor; }, why});
    }
  }
}

bool Accounts::is_of(const std::string& actor, const std::string& user) const {
  return account_of(actor) == "user:" + user;
}

void Accounts::end_right_of(const std::string& actor, std::string why) const {
  rights_.end({[&actor](const std::string& each) { return each == actor; }, std::move(why)}, {});
}

void Accounts::end_pages_of(const std::string& user, const std::string& by) {
  sessions_.end_of_user(user);
  const std::string pages = fmt::format("user:{}/", user);
  rights_.end({[&pages](const std::string& actor) { return actor.starts_with(pages); },
               fmt::format("the password of user '{}' was set by {}", user, by)},
              {});
}

// Whatever page or token of theirs it acts by.
void Accounts::end_rights_of(const std::string& user, Scopes left, std::string why) const {
  rights_.end({[this, &user](const std::string& actor) { return is_of(actor, user); }, std::move(why)}, left);
}

}  // namespace server::identity
