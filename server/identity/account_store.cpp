// SQL of accounts; tables of some hundred rows at most.
#include "server/identity/account_store.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "server/storage/audit/audit_chain.hpp"
#include "server/storage/database/statement.hpp"

namespace server::identity {
namespace {

runtime::SecretHash read_hash(const SQLite::Column& column) {
  runtime::SecretHash hash{};
  const auto* const bytes = static_cast<const unsigned char*>(column.getBlob());
  if (static_cast<std::size_t>(column.getBytes()) == hash.size()) std::copy_n(bytes, hash.size(), hash.begin());
  return hash;
}

void bind_hash(SQLite::Statement& statement, int index, const runtime::SecretHash& hash) {
  statement.bind(index, hash.data(), static_cast<int>(hash.size()));
}

constexpr const char* kUserColumns = "name, role, password_hash, made_at_us, made_by, disabled";

User read_user(SQLite::Statement& row) {
  return {row.getColumn(0).getString(), parse_role(row.getColumn(1).getString()).value_or(Role::viewer),
          row.getColumn(2).getString(), row.getColumn(3).getInt64(),
          row.getColumn(4).getString(), row.getColumn(5).getInt() != 0};
}

constexpr const char* kTokenColumns =
    "name, hash, scopes, owner, made_at_us, last_used_at_us, expires_at_us, revoked_at_us, expired_at_us";

ApiToken read_token(SQLite::Statement& row) {
  return {row.getColumn(0).getString(),
          read_hash(row.getColumn(1)),
          parse_scopes(row.getColumn(2).getString()).value_or(Scopes{}),
          row.getColumn(3).getString(),
          row.getColumn(4).getInt64(),
          row.getColumn(5).getInt64(),
          row.getColumn(6).getInt64(),
          row.getColumn(7).getInt64(),
          row.getColumn(8).getInt64()};
}

PageSession read_session(SQLite::Statement& row) {
  return {storage::unsigned_id(row.getColumn(0)),
          read_hash(row.getColumn(1)),
          row.getColumn(2).getString(),
          row.getColumn(3).getInt64(),
          row.getColumn(4).getInt64(),
          row.getColumn(5).getInt64(),
          row.getColumn(6).getString(),
          row.getColumn(7).getString()};
}

constexpr const char* kRobotColumns =
    "robot_id, token_hash IS NOT NULL, enrolled_at_us, enrolled_by, coalesce(revoked_at_us, 0),"
    " coalesce(revoked_by, ''), coalesce(retired_at_us, 0), coalesce(retired_by, '')";

Enrolment read_enrolment(SQLite::Statement& row) {
  return {row.getColumn(0).getString(), row.getColumn(1).getInt() != 0, row.getColumn(2).getInt64(),
          row.getColumn(3).getString(), row.getColumn(4).getInt64(),    row.getColumn(5).getString(),
          row.getColumn(6).getInt64(),  row.getColumn(7).getString()};
}

template <class Read>
auto read_all(SQLite::Database& database, const std::string& sql, Read read) {
  std::vector<std::invoke_result_t<Read, SQLite::Statement&>> rows;
  SQLite::Statement query{database, sql};
  while (query.executeStep()) rows.push_back(read(query));
  return rows;
}

std::unexpected<Error> unknown(const char* what, const std::string& name) {
  return fail(ErrorCode::not_found, fmt::format("there is no {} '{}'", what, name.substr(0, 40)), "unknown_name");
}

}  // namespace

Error has_ended_for_good(const std::string& token) {
  return {ErrorCode::conflict, fmt::format("token '{}' has ended for good; make a new one", token), "token_has_ended"};
}

StoredAccounts AccountStore::load() {
  StoredAccounts stored;
  stored.users = read_all(database_, fmt::format("SELECT {} FROM user ORDER BY name", kUserColumns), read_user);
  stored.tokens = read_all(database_, fmt::format("SELECT {} FROM api_token ORDER BY name", kTokenColumns), read_token);
  stored.sessions = read_all(database_,
                             "SELECT session, hash, user, made_at_us, last_used_at_us, ends_at_us, peer, agent"
                             " FROM page_session ORDER BY session",
                             read_session);
  stored.next_session = storage::unsigned_id(
      database_.execAndGet("SELECT max(coalesce((SELECT value FROM meta WHERE name = 'next_session'), 1),"
                           " coalesce((SELECT max(session) FROM page_session), 0) + 1)"));
  stored.revoked_robots = read_all(database_, "SELECT robot_id FROM robot WHERE revoked_at_us IS NOT NULL",
                                   [](SQLite::Statement& row) { return row.getColumn(0).getString(); });
  return stored;
}

std::size_t AccountStore::count(const char* sql) {
  return static_cast<std::size_t>(database_.execAndGet(sql).getInt64());
}

std::optional<User> AccountStore::find_user(const std::string& name) {
  SQLite::Statement query{database_, fmt::format("SELECT {} FROM user WHERE name = ?", kUserColumns)};
  storage::bind_all(query, name);
  return query.executeStep() ? std::optional{read_user(query)} : std::nullopt;
}

std::optional<ApiToken> AccountStore::find_token(const std::string& name) {
  SQLite::Statement query{database_, fmt::format("SELECT {} FROM api_token WHERE name = ?", kTokenColumns)};
  storage::bind_all(query, name);
  return query.executeStep() ? std::optional{read_token(query)} : std::nullopt;
}

// In the transaction of the change. An entry about a robot names it, so that it is found with the robot's others.
void AccountStore::note(const station::Author& by, const char* action, const std::string& subject,
                        const nlohmann::json& detail) {
  station::AuditNote note;
  note.by = by;
  note.action = action;
  const bool is_of_robot = note.action.starts_with("robot.");
  (is_of_robot ? note.robot_id : note.subject) = subject;
  note.detail = station::audit_detail(detail);
  storage::AuditChain{database_}.append(note);
}

Result<void> AccountStore::add_user(const User& user, const station::Author& by) {
  SQLite::Transaction transaction{database_, SQLite::TransactionBehavior::IMMEDIATE};
  if (find_user(user.name)) {
    return fail(ErrorCode::conflict, fmt::format("there is a user '{}' already", user.name), "name_taken");
  }
  if (count("SELECT count(*) FROM user") >= kMaxUsers) {
    return fail(ErrorCode::conflict, fmt::format("there are {} users; remove one first", kMaxUsers), "too_many");
  }
  SQLite::Statement add{database_, fmt::format("INSERT INTO user ({}) VALUES (?, ?, ?, ?, ?, ?)", kUserColumns)};
  storage::execute(add, user.name, text(user.role), user.password_hash, user.made_at_us, user.made_by,
                   std::int64_t{user.disabled});
  note(by, "account.user_added", user.name, {{"role", text(user.role)}});
  transaction.commit();
  return {};
}

Result<User> AccountStore::change_user(const std::string& name, const UserChange& change, const station::Author& by) {
  SQLite::Transaction transaction{database_, SQLite::TransactionBehavior::IMMEDIATE};
  std::optional<User> user = find_user(name);
  if (!user) return unknown("user", name);
  user->role = change.role.value_or(user->role);
  user->password_hash = change.password_hash.value_or(user->password_hash);
  user->disabled = change.disabled.value_or(user->disabled);
  SQLite::Statement update{database_, "UPDATE user SET role = ?, password_hash = ?, disabled = ? WHERE name = ?"};
  storage::execute(update, text(user->role), user->password_hash, std::int64_t{user->disabled}, name);
  if (change.password_hash || user->disabled) {
    SQLite::Statement end{database_, "DELETE FROM page_session WHERE user = ?"};
    storage::execute(end, name);
  }
  nlohmann::json detail{{"role", text(user->role)}, {"disabled", user->disabled}};
  if (change.password_hash) detail["password"] = "changed";
  note(by, "account.user_changed", name, detail);
  transaction.commit();
  return *user;
}

Result<void> AccountStore::remove_user(const std::string& name, const station::Author& by) {
  SQLite::Transaction transaction{database_, SQLite::TransactionBehavior::IMMEDIATE};
  SQLite::Statement remove{database_, "DELETE FROM user WHERE name = ?"};
  if (storage::execute(remove, name) == 0) return unknown("user", name);
  SQLite::Statement end{database_, "DELETE FROM page_session WHERE user = ?"};
  storage::execute(end, name);
  SQLite::Statement revoke{database_, "UPDATE api_token SET revoked_at_us = ? WHERE owner = ? AND revoked_at_us = 0"};
  storage::execute(revoke, by.at_us, name);
  note(by, "account.user_removed", name, nlohmann::json::object());
  transaction.commit();
  return {};
}

Result<void> AccountStore::add_token(const ApiToken& token, const station::Author& by) {
  SQLite::Transaction transaction{database_, SQLite::TransactionBehavior::IMMEDIATE};
  SQLite::Statement known{database_, "SELECT 1 FROM api_token WHERE name = ?"};
  storage::bind_all(known, token.name);
  if (known.executeStep()) {
    return fail(ErrorCode::conflict,
                fmt::format("there is, or was, a token '{}'; the record of commands names tokens, so take another name",
                            token.name),
                "name_taken");
  }
  if (count("SELECT count(*) FROM api_token WHERE revoked_at_us = 0") >= kMaxTokens) {
    return fail(ErrorCode::conflict, fmt::format("{} tokens are in use; revoke one first", kMaxTokens), "too_many");
  }
  SQLite::Statement add{database_,
                        fmt::format("INSERT INTO api_token ({}) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", kTokenColumns)};
  add.bind(1, token.name);
  bind_hash(add, 2, token.hash);
  add.bind(3, text(token.scopes));
  add.bind(4, token.owner);
  add.bind(5, token.made_at_us);
  add.bind(6, token.last_used_at_us);
  add.bind(7, token.expires_at_us);
  add.bind(8, token.revoked_at_us);
  add.bind(9, token.expired_at_us);
  add.exec();
  SQLite::Statement forget{database_,
                           "DELETE FROM api_token WHERE name IN (SELECT name FROM api_token WHERE revoked_at_us <> 0"
                           " ORDER BY revoked_at_us DESC LIMIT -1 OFFSET ?)"};
  storage::execute(forget, static_cast<std::int64_t>(kMaxTokens));
  note(by, "account.token_made", token.name,
       {{"scopes", text(token.scopes)}, {"owner", token.owner}, {"expires_at_us", token.expires_at_us}});
  transaction.commit();
  return {};
}

Result<ApiToken> AccountStore::revoke_token(const std::string& name, const station::Author& by) {
  SQLite::Transaction transaction{database_, SQLite::TransactionBehavior::IMMEDIATE};
  SQLite::Statement revoke{database_, "UPDATE api_token SET revoked_at_us = ?1 WHERE name = ?2 AND revoked_at_us = 0"};
  const bool was_good = storage::execute(revoke, by.at_us, name) > 0;
  const std::optional<ApiToken> token = find_token(name);
  if (!token) return unknown("token", name);
  if (was_good) note(by, "account.token_revoked", name, nlohmann::json::object());
  transaction.commit();
  return *token;
}

void AccountStore::note_expiry(const station::Author& by, const std::string& token, std::int64_t expired_at_us) {
  note(by, "account.token_expired", token, {{"expired_at_us", expired_at_us}});
}

Result<void> AccountStore::expire_token(const std::string& name, std::int64_t expired_at_us,
                                        const station::Author& by) {
  SQLite::Transaction transaction{database_, SQLite::TransactionBehavior::IMMEDIATE};
  SQLite::Statement expire{database_, "UPDATE api_token SET expired_at_us = ? WHERE name = ? AND expired_at_us = 0"};
  const bool is_new = storage::execute(expire, expired_at_us, name) > 0;
  if (is_new) note_expiry(by, name, expired_at_us);
  transaction.commit();
  return {};
}

Result<ApiToken> AccountStore::revive_token(const std::string& name, std::int64_t seen_us, const station::Author& by) {
  SQLite::Transaction transaction{database_, SQLite::TransactionBehavior::IMMEDIATE};
  std::optional<ApiToken> token = find_token(name);
  if (!token) return unknown("token", name);
  if (token->revoked_at_us != 0) {
    return std::unexpected{has_ended_for_good(name)};
  }
  if (token->expires_at_us != 0 && token->expires_at_us <= by.at_us) {
    return fail(
        ErrorCode::conflict,
        fmt::format("token '{}' has expired by this computer's clock; make a new one, or set the clock right", name),
        "token_has_ended");
  }
  if (token->expired_at_us == 0 && seen_us == 0) {
    return fail(ErrorCode::conflict, fmt::format("token '{}' has not expired: nothing was changed", name),
                "token_not_expired");
  }
  if (token->expired_at_us == 0) note_expiry({"station", "", by.at_us}, name, seen_us);
  SQLite::Statement revive{database_, "UPDATE api_token SET expired_at_us = 0 WHERE name = ?"};
  storage::execute(revive, name);
  note(by, "account.token_revived", name, nlohmann::json::object());
  transaction.commit();
  token->expired_at_us = 0;
  return *token;
}

void AccountStore::replace_sessions(const std::vector<PageSession>& sessions, std::uint64_t next_session,
                                    const std::vector<ApiToken>& used_tokens) {
  SQLite::Transaction transaction{database_, SQLite::TransactionBehavior::IMMEDIATE};
  database_.exec("DELETE FROM page_session");
  SQLite::Statement add{database_,
                        "INSERT INTO page_session (session, hash, user, made_at_us, last_used_at_us, ends_at_us, peer,"
                        " agent) VALUES (?, ?, ?, ?, ?, ?, ?, ?)"};
  for (const PageSession& session : sessions) {
    add.bind(1, storage::signed_id(session.number));
    bind_hash(add, 2, session.hash);
    add.bind(3, session.user);
    add.bind(4, session.made_at_us);
    add.bind(5, session.last_used_at_us);
    add.bind(6, session.ends_at_us);
    add.bind(7, session.peer);
    add.bind(8, session.agent);
    add.exec();
    add.reset();
  }
  SQLite::Statement number{database_, "INSERT OR REPLACE INTO meta (name, value) VALUES ('next_session', ?)"};
  storage::execute(number, next_session);
  SQLite::Statement use{database_, "UPDATE api_token SET last_used_at_us = ? WHERE name = ?"};
  for (const ApiToken& token : used_tokens) storage::execute(use, token.last_used_at_us, token.name);
  transaction.commit();
}

std::vector<Enrolment> AccountStore::enrolments() {
  return read_all(database_, fmt::format("SELECT {} FROM robot ORDER BY robot_id", kRobotColumns), read_enrolment);
}

std::optional<Enrolment> AccountStore::find_robot(const std::string& robot_id) {
  SQLite::Statement query{database_, fmt::format("SELECT {} FROM robot WHERE robot_id = ?", kRobotColumns)};
  storage::bind_all(query, robot_id);
  return query.executeStep() ? std::optional{read_enrolment(query)} : std::nullopt;
}

Result<Enrolment> AccountStore::enrol(const std::string& robot_id, const runtime::SecretHash& token,
                                      const station::Author& by) {
  SQLite::Transaction transaction{database_, SQLite::TransactionBehavior::IMMEDIATE};
  const std::optional<Enrolment> known = find_robot(robot_id);
  if (known && known->has_token && known->revoked_at_us == 0) {
    return fail(ErrorCode::conflict, fmt::format("robot '{}' has a token already; revoke it first", robot_id),
                "already_enrolled");
  }
  SQLite::Statement add{database_,
                        "INSERT INTO robot (robot_id, token_hash, enrolled_at_us, enrolled_by) VALUES (?, ?, ?, ?)"
                        " ON CONFLICT (robot_id) DO UPDATE SET token_hash = excluded.token_hash,"
                        " enrolled_at_us = excluded.enrolled_at_us, enrolled_by = excluded.enrolled_by,"
                        " revoked_at_us = NULL, revoked_by = NULL"};
  add.bind(1, robot_id);
  bind_hash(add, 2, token);
  add.bind(3, by.at_us);
  add.bind(4, by.actor);
  add.exec();
  note(by, "robot.enrolled", robot_id, {{"token", true}});
  const std::optional<Enrolment> enrolled = find_robot(robot_id);
  transaction.commit();
  return *enrolled;
}

Result<Enrolment> AccountStore::revoke_robot(const std::string& robot_id, const station::Author& by) {
  SQLite::Transaction transaction{database_, SQLite::TransactionBehavior::IMMEDIATE};
  SQLite::Statement revoke{database_,
                           "UPDATE robot SET revoked_at_us = ?, revoked_by = ?"
                           " WHERE robot_id = ? AND revoked_at_us IS NULL"};
  const bool was_good = storage::execute(revoke, by.at_us, by.actor, robot_id) > 0;
  const std::optional<Enrolment> revoked = find_robot(robot_id);
  if (!revoked) return unknown("robot", robot_id);
  if (was_good) note(by, "robot.revoked", robot_id, nlohmann::json::object());
  transaction.commit();
  return *revoked;
}

Result<Enrolment> AccountStore::set_retired(const std::string& robot_id, bool retired, const station::Author& by) {
  SQLite::Transaction transaction{database_, SQLite::TransactionBehavior::IMMEDIATE};
  SQLite::Statement retire{database_,
                           "UPDATE robot SET retired_at_us = ?2, retired_by = ?3"
                           " WHERE robot_id = ?1 AND (retired_at_us IS NULL) = ?4"};
  storage::bind_all(retire, robot_id);
  if (retired) {
    retire.bind(2, by.at_us);
    retire.bind(3, by.actor);
  }
  retire.bind(4, retired ? 1 : 0);
  const bool is_change = retire.exec() > 0;
  const std::optional<Enrolment> enrolment = find_robot(robot_id);
  if (!enrolment) return unknown("robot", robot_id);
  if (is_change) note(by, retired ? "robot.retired" : "robot.unretired", robot_id, nlohmann::json::object());
  transaction.commit();
  return *enrolment;
}

}  // namespace server::identity
