// Who may do what: roles and scopes, and users, API tokens, page sessions and enrolled robots as plain values.
//
// A role is what a person may do, a scope is one part of that, and a token has some of them. Every route needs one
// scope; a refusal names the least role that has it. Times are UTC in microseconds, 0: never.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "server/runtime/result.hpp"
#include "server/runtime/secrets.hpp"

namespace server::identity {

enum class Role : std::uint8_t {
  viewer,     // sees everything, and may stop
  operator_,  // and commands robots, makes runs, markers and exports
  admin,      // and looks after users, tokens, robots and backups
};
inline constexpr std::array kRoles{Role::viewer, Role::operator_, Role::admin};

enum class Scope : std::uint8_t {
  anyone,  // nobody needs to say who they are
  read,
  stop,
  record,   // and read
  command,  // and read and stop
  admin,    // everything
  look,     // what is shown to a caller who may stop: read and stop include it, no token has it by name
};
inline constexpr std::array kTokenScopes{Scope::read, Scope::stop, Scope::record, Scope::command, Scope::admin};

const char* text(Role role);
const char* text(Scope scope);
Result<Role> parse_role(const std::string& text);
Role least_role(Scope scope);  // that has it

class Scopes {
 public:
  Scopes() = default;  // none
  static Scopes of(Role role);

  Scopes& add(Scope scope);  // with what it brings along
  bool allow(Scope scope) const { return scope == Scope::anyone || (bits_ & bit(scope)) != 0; }
  bool empty() const { return bits_ == 0; }
  Role role() const;  // the highest of which they have everything, or viewer
  Scopes operator&(Scopes other) const;
  bool operator==(const Scopes&) const = default;

 private:
  static constexpr std::uint8_t bit(Scope scope) {
    return static_cast<std::uint8_t>(1U << static_cast<unsigned>(scope));
  }
  std::uint8_t bits_ = 0;
};

std::string text(Scopes scopes);                           // "read,stop"
Result<Scopes> parse_scopes(const std::string& text);      // at least one
Result<void> check_name(const std::string& name);          // of a user or token: 1 to 31 of [a-z0-9._-]
Result<void> check_password(const std::string& password);  // 8 to 200 bytes

struct User {
  std::string name;
  Role role = Role::viewer;
  std::string password_hash;  // Argon2id, as libsodium writes it
  std::int64_t made_at_us = 0;
  std::string made_by;  // the actor
  bool disabled = false;
};

struct ApiToken {
  std::string name;
  runtime::SecretHash hash{};
  Scopes scopes;
  std::string owner;  // a user; empty: the station itself
  std::int64_t made_at_us = 0;
  std::int64_t last_used_at_us = 0;
  std::int64_t expires_at_us = 0;
  std::int64_t revoked_at_us = 0;
  std::int64_t expired_at_us = 0;  // when the clock was first seen past expires_at_us; it is refused since
};

struct PageSession {
  std::uint64_t number = 0;
  runtime::SecretHash hash{};
  std::string user;  // empty: let in by a one-time link
  std::int64_t made_at_us = 0;
  std::int64_t last_used_at_us = 0;
  std::int64_t ends_at_us = 0;
  std::string peer;   // the address it was made from
  std::string agent;  // what the browser says it is
};

struct Enrolment {
  std::string robot_id;
  bool has_token = false;
  std::int64_t enrolled_at_us = 0;
  std::string enrolled_by;  // the actor; "loopback": by itself
  std::int64_t revoked_at_us = 0;
  std::string revoked_by;
  std::int64_t retired_at_us = 0;
  std::string retired_by;
};

// Without anything that is secret. A time that is 0 is null.
nlohmann::json to_json(const User& user);
nlohmann::json to_json(const ApiToken& token);
nlohmann::json to_json(const PageSession& session);
nlohmann::json to_json(const Enrolment& enrolment);

}  // namespace server::identity
