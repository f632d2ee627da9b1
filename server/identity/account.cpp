// Words of roles and scopes, and the table of what each brings along.
#include "server/identity/account.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace server::identity {

using nlohmann::json;

namespace {

constexpr std::size_t kMaxNameBytes = 31;

json time_or_null(std::int64_t at_us) { return at_us == 0 ? json(nullptr) : json(at_us); }

}  // namespace

const char* text(Role role) {
  switch (role) {
    case Role::viewer: return "viewer";
    case Role::operator_: return "operator";
    case Role::admin: return "admin";
  }
  return "";
}

const char* text(Scope scope) {
  switch (scope) {
    case Scope::anyone: return "anyone";
    case Scope::read: return "read";
    case Scope::stop: return "stop";
    case Scope::record: return "record";
    case Scope::command: return "command";
    case Scope::admin: return "admin";
    case Scope::look: return "read or stop";
  }
  return "";
}

Result<Role> parse_role(const std::string& word) {
  for (const Role role : kRoles) {
    if (word == text(role)) return role;
  }
  return fail(ErrorCode::invalid, fmt::format("role = '{}' is not viewer, operator or admin", word.substr(0, 40)),
              "out_of_range");
}

Role least_role(Scope scope) {
  for (const Role role : kRoles) {
    if (Scopes::of(role).allow(scope)) return role;
  }
  return Role::admin;
}

Scopes Scopes::of(Role role) {
  Scopes scopes;
  scopes.add(Scope::read).add(Scope::stop);
  if (role != Role::viewer) scopes.add(Scope::record).add(Scope::command);
  if (role == Role::admin) scopes.add(Scope::admin);
  return scopes;
}

// SAFETY: the scope command includes stop, even for a token without it.
Scopes& Scopes::add(Scope scope) {
  bits_ |= bit(scope);
  if (scope == Scope::read || scope == Scope::stop) add(Scope::look);
  if (scope == Scope::record) add(Scope::read);
  if (scope == Scope::command) add(Scope::read).add(Scope::stop);
  if (scope == Scope::admin) add(Scope::record).add(Scope::command);
  return *this;
}

Scopes Scopes::operator&(Scopes other) const {
  Scopes both;
  both.bits_ = bits_ & other.bits_;
  return both;
}

Role Scopes::role() const {
  Role highest = Role::viewer;
  for (const Role role : kRoles) {
    if ((*this & of(role)) == of(role)) highest = role;
  }
  return highest;
}

std::string text(Scopes scopes) {
  std::string words;
  for (const Scope scope : kTokenScopes) {
    if (scopes.allow(scope)) words += (words.empty() ? "" : ",") + std::string{text(scope)};
  }
  return words;
}

Result<Scopes> parse_scopes(const std::string& words) {
  Scopes scopes;
  for (std::size_t begin = 0; begin <= words.size();) {
    const std::size_t end = std::min(words.find(',', begin), words.size());
    const std::string word = words.substr(begin, end - begin);
    const auto* const scope = std::ranges::find_if(kTokenScopes, [&word](Scope one) { return word == text(one); });
    if (scope == kTokenScopes.end()) {
      return fail(ErrorCode::invalid,
                  fmt::format("scope '{}' is none of read, stop, record, command, admin", word.substr(0, 40)),
                  "out_of_range");
    }
    scopes.add(*scope);
    begin = end + 1;
  }
  return scopes;
}

Result<void> check_name(const std::string& name) {
  constexpr auto kAllowed = "abcdefghijklmnopqrstuvwxyz0123456789._-";
  if (!name.empty() && name.size() <= kMaxNameBytes && name.find_first_not_of(kAllowed) == std::string::npos) return {};
  return fail(ErrorCode::invalid,
              fmt::format("name = '{}' is not 1 to {} characters of [a-z0-9._-]", name.substr(0, 40), kMaxNameBytes),
              "out_of_range");
}

Result<void> check_password(const std::string& password) {
  if (password.size() >= runtime::kMinPasswordBytes && password.size() <= runtime::kMaxPasswordBytes) return {};
  return fail(ErrorCode::invalid,
              fmt::format("the password has {} bytes, allowed are {} to {}", password.size(),
                          runtime::kMinPasswordBytes, runtime::kMaxPasswordBytes),
              "out_of_range");
}

json to_json(const User& user) {
  return {{"name", user.name},
          {"role", text(user.role)},
          {"made_at_us", user.made_at_us},
          {"made_by", user.made_by},
          {"disabled", user.disabled}};
}

json to_json(const ApiToken& token) {
  return {{"name", token.name},
          {"scopes", text(token.scopes)},
          {"owner", token.owner},
          {"made_at_us", token.made_at_us},
          {"last_used_at_us", time_or_null(token.last_used_at_us)},
          {"expires_at_us", time_or_null(token.expires_at_us)},
          {"expired_at_us", time_or_null(token.expired_at_us)},
          {"revoked_at_us", time_or_null(token.revoked_at_us)}};
}

json to_json(const PageSession& session) {
  return {{"session", session.number},
          {"user", session.user},
          {"made_at_us", session.made_at_us},
          {"last_used_at_us", session.last_used_at_us},
          {"ends_at_us", session.ends_at_us},
          {"peer", session.peer},
          {"agent", session.agent}};
}

json to_json(const Enrolment& enrolment) {
  return {{"robot_id", enrolment.robot_id},
          {"has_token", enrolment.has_token},
          {"enrolled_at_us", enrolment.enrolled_at_us},
          {"enrolled_by", enrolment.enrolled_by},
          {"revoked_at_us", time_or_null(enrolment.revoked_at_us)},
          {"revoked_by", enrolment.revoked_by},
          {"retired_at_us", time_or_null(enrolment.retired_at_us)},
          {"retired_by", enrolment.retired_by}};
}

}  // namespace server::identity
