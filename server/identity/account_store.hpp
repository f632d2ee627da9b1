// SQL of accounts: users, API tokens, sessions of pages, and the enrolment of robots.
//
// On the thread that owns the handle: a running station's disk thread, or a tool that holds the data folder's lock.
// Each change is one transaction, with its entry in the audit. A Result's error goes to the caller; SQLite's own
// failures are exceptions.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/identity/account.hpp"
#include "server/station/state/audit_note.hpp"

namespace server::identity {

inline constexpr std::size_t kMaxUsers = 100;
inline constexpr std::size_t kMaxTokens = 200;

// What a station keeps in memory.
struct StoredAccounts {
  std::vector<User> users;            // by name
  std::vector<ApiToken> tokens;       // by name
  std::vector<PageSession> sessions;  // by number
  std::uint64_t next_session = 1;
  std::vector<std::string> revoked_robots;
};

// The fields of a user that change; an empty one stays.
struct UserChange {
  std::optional<Role> role;
  std::optional<std::string> password_hash;
  std::optional<bool> disabled;
};

Error has_ended_for_good(const std::string& token);

class AccountStore {
 public:
  explicit AccountStore(SQLite::Database& database) : database_{database} {}

  StoredAccounts load();

  // conflict: there is one of that name, or there are kMaxUsers.
  Result<void> add_user(const User& user, const station::Author& by);
  // not_found. A new password, or a user who is disabled, ends the user's sessions.
  Result<User> change_user(const std::string& name, const UserChange& change, const station::Author& by);
  Result<void> remove_user(const std::string& name, const station::Author& by);  // with sessions; tokens are revoked

  // conflict: there was one of that name, or kMaxTokens are in use. The oldest of more than kMaxTokens that were
  // revoked is forgotten.
  Result<void> add_token(const ApiToken& token, const station::Author& by);
  Result<ApiToken> revoke_token(const std::string& name, const station::Author& by);
  Result<void> expire_token(const std::string& name, std::int64_t expired_at_us, const station::Author& by);
  // A token that has expired by a clock that was wrong holds again. `seen_us`: when the station saw it expire, which
  // the disk may not know yet; 0: it has not. conflict: it has not expired, it was revoked, or it has expired by
  // `by.at_us`, too.
  Result<ApiToken> revive_token(const std::string& name, std::int64_t seen_us, const station::Author& by);

  // Everything that is in `sessions` is stored then, and nothing else; the tokens were last used then.
  void replace_sessions(const std::vector<PageSession>& sessions, std::uint64_t next_session,
                        const std::vector<ApiToken>& used_tokens);

  std::vector<Enrolment> enrolments();  // by robot
  // A robot that is new, was revoked, or has no token: it needs this one from now on. conflict: it has another.
  Result<Enrolment> enrol(const std::string& robot_id, const runtime::SecretHash& token, const station::Author& by);
  Result<Enrolment> revoke_robot(const std::string& robot_id, const station::Author& by);
  // A robot that is out of use: it may still connect. not_found.
  Result<Enrolment> set_retired(const std::string& robot_id, bool retired, const station::Author& by);

 private:
  std::optional<User> find_user(const std::string& name);
  std::optional<ApiToken> find_token(const std::string& name);
  std::optional<Enrolment> find_robot(const std::string& robot_id);
  std::size_t count(const char* sql);
  void note_expiry(const station::Author& by, const std::string& token, std::int64_t expired_at_us);
  void note(const station::Author& by, const char* action, const std::string& subject, const nlohmann::json& detail);

  SQLite::Database& database_;
};

}  // namespace server::identity
