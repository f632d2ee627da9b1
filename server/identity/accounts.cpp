// Memory first for what takes rights away, disk first for what gives them.
#include "server/identity/accounts.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "server/runtime/exceptions.hpp"
#include "server/storage/database/database.hpp"
#include "server/storage/database/removal_clock.hpp"

namespace server::identity {
namespace asio = boost::asio;

namespace {

constexpr microseconds kSweepInterval{std::chrono::minutes{1}};
constexpr microseconds kRetryInterval{std::chrono::seconds{5}};
constexpr std::int64_t kUseSaveInterval = 60'000'000;
constexpr std::int64_t kDayUs = 86'400'000'000;

std::string actor_of(const std::string& user, std::uint64_t session) {
  return user.empty() ? fmt::format("session:{}", session) : fmt::format("user:{}/session:{}", user, session);
}

// A right that was taken away stays away while the station runs, but the disk does not know it.
Error not_stored(Error error) {
  if (error.code != ErrorCode::unavailable) return error;
  error.detail += ". It is in force, and a restart would undo it: do what GET /api/v1/recording says, and ask again";
  return error;
}

}  // namespace

Accounts::Accounts(asio::io_context& loop, runtime::Clock& clock, storage::Recorder& recorder,
                   const storage::RemovalClock& removal_clock, const std::filesystem::path& data_dir)
    : loop_{loop},
      clock_{clock},
      recorder_{recorder},
      removal_clock_{removal_clock},
      old_sessions_file_{data_dir / "rheonaut.sessions"},
      sessions_{loop, clock},
      changed_{loop} {
  SQLite::Database database = storage::open_for_reading(recorder.path());
  const StoredAccounts stored = AccountStore{database}.load();
  for (const User& user : stored.users) users_.emplace(user.name, user);
  for (const ApiToken& token : stored.tokens) {
    tokens_.push_back({token, std::make_shared<Standing>(loop), token.expired_at_us != 0});
  }
  sessions_.load(stored.sessions, stored.next_session);
  if (sessions_.take_over(old_sessions_file_) == 0) {
    std::error_code ignored;
    std::filesystem::remove(old_sessions_file_, ignored);
  }
  for (const std::string& robot_id : stored.revoked_robots) recorder_.set_revoked(robot_id, true);
}

template <class Job>
asio::awaitable<std::invoke_result_t<Job, AccountStore&>> Accounts::on_store(Job job) {
  auto guarded = [job = std::move(job)](storage::Database& database) -> std::invoke_result_t<Job, AccountStore&> {
    try {
      AccountStore store{database.handle()};
      return job(store);
    } catch (const SQLite::Exception& error) {
      spdlog::error("accounts: {}", runtime::text_of(error));
      return fail(ErrorCode::unavailable, "the station's disk cannot store it now; its log says why", "not_stored");
    }
  };
  co_return co_await recorder_.on_disk(std::move(guarded));
}

asio::awaitable<void> Accounts::run() {
  for (;;) {
    sessions_.sweep();
    const bool to_save = sessions_.revision() + token_uses_ != saved_revision_;
    const bool saved = co_await store_expired() && (!to_save || co_await save());
    if (saved && sessions_.revision() + token_uses_ != saved_revision_) continue;  // changed meanwhile
    if (saved) {
      co_await changed_.wait_until(clock_, clock_.steady_us() + kSweepInterval.count());
    } else {
      co_await clock_.sleep_for(kRetryInterval);
    }
  }
}

asio::awaitable<bool> Accounts::save() {
  const std::uint64_t revision = sessions_.revision() + token_uses_;
  auto job = [rows = sessions_.rows(), next = sessions_.next_number(), used = tokens()](AccountStore& store) {
    store.replace_sessions(rows, next, used);
    return Result<void>{};
  };
  const auto saved = co_await on_store(std::move(job));
  if (!saved) {
    if (!std::exchange(save_failed_, true)) spdlog::warn("sessions are kept in memory only: {}", saved.error().detail);
    co_return false;
  }
  if (std::exchange(save_failed_, false)) spdlog::info("sessions are stored again");
  saved_revision_ = revision;
  sessions_.on_saved();
  std::error_code ignored;
  std::filesystem::remove(old_sessions_file_, ignored);  // its content is in the database now
  co_return true;
}

// Stores which tokens have expired, for the next start, and ends those for good that a clock has ended which proved
// right.
asio::awaitable<bool> Accounts::store_expired() {
  for (Token& token : tokens_) {
    if (token.expired_at_us == 0 || token.revoked_at_us != 0) continue;
    const station::Author by{"station", "", clock_.utc_us()};
    if (!token.is_expiry_stored) {
      auto job = [name = token.name, at_us = token.expired_at_us, by](AccountStore& store) {
        return store.expire_token(name, at_us, by);
      };
      const auto stored = co_await on_store(std::move(job));
      if (!stored) co_return false;
      token.is_expiry_stored = token.expired_at_us != 0;  // unless it was revived meanwhile
    }
    const bool is_for_good = token.expired_at_us != 0 &&
                             removal_clock_.utc_us() - token.expires_at_us >= storage::RemovalClock::kStandsBy.count();
    if (!is_for_good) continue;
    auto job = [name = token.name, by](AccountStore& store) { return store.revoke_token(name, by); };
    const auto revoked = co_await on_store(std::move(job));
    if (!revoked) co_return false;
    end_token(token, by.at_us);
  }
  co_return true;
}

// A user's role bounds what their pages and tokens may do, at every request anew.
Caller Accounts::caller(std::string actor, const std::string& user, Scopes scopes,
                        std::shared_ptr<Standing> standing) const {
  if (!user.empty()) {
    const User* known = find_user(user);
    scopes = known != nullptr && !known->disabled ? scopes & Scopes::of(known->role) : Scopes{};
  }
  return {std::move(actor), user, scopes, 0, std::move(standing), {}};
}

std::optional<Caller> Accounts::caller_of_token(const std::string& secret) {
  Token* token = runtime::find_secret(tokens_, runtime::hash_of(secret));
  const std::int64_t now_us = clock_.utc_us();
  if (token == nullptr || token->revoked_at_us != 0) return std::nullopt;
  if (is_past(*token)) {
    note_expiry(*token);
    return std::nullopt;
  }
  Caller found = caller("token:" + token->name, token->owner, token->scopes, token->standing);
  if (found.scopes.empty()) return std::nullopt;
  if (now_us - token->last_used_at_us >= kUseSaveInterval) {
    token->last_used_at_us = now_us;
    ++token_uses_;  // written with the next sweep
  }
  return found;
}

std::optional<Caller> Accounts::caller_of_session(const std::string& secret) {
  const std::uint64_t revision = sessions_.revision();
  const Sessions::Open* session = sessions_.find(secret);
  if (sessions_.revision() != revision) changed_.notify();
  if (session == nullptr) return std::nullopt;
  Caller found =
      caller(actor_of(session->user, session->number), session->user, Scopes::of(Role::admin), session->standing);
  if (found.scopes.empty()) return std::nullopt;
  found.session = session->number;
  return found;
}

std::string Accounts::open_session(const std::string& user, const std::string& peer, const std::string& agent) {
  const std::uint64_t number = sessions_.next_number();
  std::string secret = sessions_.add(user, peer, agent);
  changed_.notify();
  note({actor_of(user, number), peer, clock_.utc_us()}, "account.signed_in", user, "{}", true);
  return secret;
}

asio::awaitable<Result<void>> Accounts::end_session(std::uint64_t number, station::Author by) {
  const auto session = std::ranges::find(sessions_.all(), number, &Sessions::Open::number);
  if (session == sessions_.all().end()) {
    co_return fail(ErrorCode::not_found, "there is no such session", "unknown_session");
  }
  const std::string user = session->user, actor = actor_of(user, number);
  sessions_.end(number);
  const bool is_own = by.actor == actor || (!user.empty() && is_of(by.actor, user));
  if (!is_own) {
    end_right_of(actor,
                 fmt::format("session {} of {} was ended by {}", number, user.empty() ? "a link" : user, by.actor));
  }
  note(std::move(by), "account.session_ended", std::to_string(number), "{}", false);
  const bool saved = co_await save();
  if (saved) co_return Result<void>{};
  changed_.notify();
  co_return fail(ErrorCode::unavailable,
                 "the session has ended, and the station's disk cannot store that now; its log says why. The station "
                 "tries again every 5 s; a restart before that would bring the session back",
                 "not_stored");
}

void Accounts::on_refused_sign_in(const std::string& user, const std::string& peer, const char* reason) {
  const std::string known = find_user(user) == nullptr ? "" : user;
  note({"", peer, clock_.utc_us()}, "account.sign_in_refused", known, fmt::format(R"({{"reason":"{}"}})", reason),
       true);
}

void Accounts::note(station::Author by, const char* action, std::string subject, std::string detail, bool can_flood) {
  station::AuditNote note;
  note.by = std::move(by);
  note.action = action;
  note.subject = std::move(subject);
  note.detail = std::move(detail);
  note.can_flood = can_flood;
  recorder_.on_audit(note);
}

const User* Accounts::find_user(const std::string& name) const {
  const auto user = users_.find(name);
  return user == users_.end() ? nullptr : &user->second;
}

asio::awaitable<Result<User>> Accounts::add_user(User user, station::Author by) {
  user.made_at_us = by.at_us;
  user.made_by = by.actor;
  auto job = [user, by](AccountStore& store) { return store.add_user(user, by); };
  const auto added = co_await on_store(std::move(job));
  if (!added) co_return std::unexpected{added.error()};
  users_.insert_or_assign(user.name, user);
  co_return user;
}

void Accounts::renew_standing(const std::string& user) {
  sessions_.renew_standing(user);
  for (Token& token : tokens_) {
    if (token.owner != user) continue;
    token.standing->end();
    token.standing = std::make_shared<Standing>(loop_);
  }
}

asio::awaitable<Result<User>> Accounts::change_user(std::string name, UserChange change, station::Author by) {
  const auto known = users_.find(name);
  const bool ends_sessions = change.password_hash.has_value() || change.disabled.value_or(false);
  const bool takes_rights =
      change.disabled.value_or(false) || (known != users_.end() && change.role && *change.role < known->second.role);
  if (known != users_.end() && takes_rights) {
    known->second.role = std::min(known->second.role, change.role.value_or(Role::admin));
    known->second.disabled = known->second.disabled || change.disabled.value_or(false);
    renew_standing(name);
    if (known->second.disabled) sessions_.end_of_user(name);
    const bool is_out = known->second.disabled;
    const Scopes left = is_out ? Scopes{} : Scopes::of(known->second.role);
    const std::string now = is_out ? "disabled" : fmt::format("made {}", text(known->second.role));
    end_rights_of(name, left, fmt::format("user '{}' was {} by {}", name, now, by.actor));
  }
  // Somebody else who sets a password takes the pages from the person who opened them.
  if (known != users_.end() && change.password_hash && !is_of(by.actor, name)) {
    end_pages_of(name, by.actor);
  }
  auto job = [name, change, by](AccountStore& store) { return store.change_user(name, change, by); };
  auto changed = co_await on_store(std::move(job));
  if (!changed) co_return std::unexpected{takes_rights ? not_stored(changed.error()) : changed.error()};
  const auto still = users_.find(name);  // not if it has been removed meanwhile
  if (still != users_.end()) still->second = *changed;
  if (change.password_hash && !is_of(by.actor, name)) {
    end_pages_of(name, by.actor);  // also one that was opened meanwhile, by the old password
  } else if (ends_sessions) {
    sessions_.end_of_user(name);
  }
  if (change.role || change.disabled) renew_standing(name);
  changed_.notify();
  co_return changed;
}

asio::awaitable<Result<void>> Accounts::remove_user(std::string name, station::Author by) {
  users_.erase(name);
  sessions_.end_of_user(name);
  for (Token& token : tokens_) {
    if (token.owner == name) end_token(token, by.at_us);
  }
  end_rights_of(name, {}, fmt::format("user '{}' was removed by {}", name, by.actor));
  changed_.notify();
  auto job = [name, by](AccountStore& store) { return store.remove_user(name, by); };
  const auto removed = co_await on_store(std::move(job));
  if (!removed) co_return std::unexpected{not_stored(removed.error())};
  users_.erase(name);  // one that was added or changed while this waited for the disk
  sessions_.end_of_user(name);
  co_return Result<void>{};
}

std::string Accounts::account_of(const std::string& actor) const {
  constexpr std::string_view kUser = "user:", kToken = "token:";
  if (actor.starts_with(kUser)) return actor.substr(0, actor.find('/'));
  if (!actor.starts_with(kToken)) return actor;
  // No two tokens have had the same name.
  const auto found = std::ranges::find(tokens_, actor.substr(kToken.size()), &Token::name);
  return found == tokens_.end() || found->owner.empty() ? actor : fmt::format("{}{}", kUser, found->owner);
}

bool Accounts::is_account(const std::string& account) const {
  const auto is_page = [&account](const Sessions::Open& open) { return actor_of(open.user, open.number) == account; };
  const auto is_script = [&account](const Token& known) {
    return known.owner.empty() && known.revoked_at_us == 0 && account == "token:" + known.name;
  };
  const auto is_user = [&account](const auto& user) {
    return !user.second.disabled && "user:" + user.first == account;
  };
  return account == "token:local" || std::ranges::any_of(users_, is_user) || std::ranges::any_of(tokens_, is_script) ||
         std::ranges::any_of(sessions_.all(), is_page);
}

std::vector<ApiToken> Accounts::tokens() const { return {tokens_.begin(), tokens_.end()}; }

asio::awaitable<Result<NewToken>> Accounts::add_token(TokenRequest request, station::Author by) {
  NewToken made;
  made.secret = runtime::random_secret();
  made.token.name = request.name;
  made.token.hash = runtime::hash_of(made.secret);
  made.token.scopes = request.scopes;
  made.token.owner = request.owner;
  made.token.made_at_us = by.at_us;
  made.token.expires_at_us = request.days == 0 ? 0 : made.token.made_at_us + request.days * kDayUs;
  auto job = [token = made.token, by](AccountStore& store) { return store.add_token(token, by); };
  const auto added = co_await on_store(std::move(job));
  if (!added) co_return std::unexpected{added.error()};
  tokens_.push_back({made.token, std::make_shared<Standing>(loop_), false});
  co_return made;
}

void Accounts::end_token(Token& token, std::int64_t utc_us) {
  if (token.revoked_at_us == 0) token.revoked_at_us = utc_us;
  token.standing->end();
}

asio::awaitable<Result<ApiToken>> Accounts::revoke_token(std::string name, station::Author by) {
  const auto found = std::ranges::find(tokens_, name, &Token::name);
  if (found != tokens_.end()) {
    end_token(*found, by.at_us);
    end_right_of("token:" + name, fmt::format("token '{}' was revoked by {}", name, by.actor));
  }
  auto job = [name, by](AccountStore& store) { return store.revoke_token(name, by); };
  const auto revoked = co_await on_store(std::move(job));
  if (!revoked) co_return std::unexpected{not_stored(revoked.error())};
  co_return revoked;
}

asio::awaitable<Result<ApiToken>> Accounts::revive_token(std::string name, station::Author by) {
  const auto found = std::ranges::find(tokens_, name, &Token::name);
  if (found == tokens_.end())
    co_return fail(ErrorCode::not_found, fmt::format("there is no token '{}'", name), "unknown_name");
  const bool was_stored = std::exchange(found->is_expiry_stored, true);  // nothing comes to the disk behind this
  auto job = [name, by, seen_us = found->expired_at_us](AccountStore& store) {
    return store.revive_token(name, seen_us, by);
  };
  auto revived = co_await on_store(std::move(job));
  if (revived && found->revoked_at_us != 0)
    revived = std::unexpected{has_ended_for_good(name)};  // the disk knows it later
  if (!revived) found->is_expiry_stored = was_stored;
  if (!revived) co_return revived;
  found->expired_at_us = 0;
  found->is_expiry_stored = false;
  if (found->standing->ended()) found->standing = std::make_shared<Standing>(loop_);
  co_return revived;
}

asio::awaitable<Result<std::vector<Enrolment>>> Accounts::enrolments() {
  auto job = [](AccountStore& store) -> Result<std::vector<Enrolment>> { return store.enrolments(); };
  co_return co_await on_store(std::move(job));
}

asio::awaitable<Result<NewEnrolment>> Accounts::enrol(std::string robot_id, station::Author by) {
  NewEnrolment made;
  made.secret = runtime::random_secret();
  auto job = [robot_id, by, hash = runtime::hash_of(made.secret)](AccountStore& store) {
    return store.enrol(robot_id, hash, by);
  };
  auto enrolled = co_await on_store(std::move(job));
  if (!enrolled) co_return std::unexpected{enrolled.error()};
  recorder_.set_revoked(robot_id, false);
  made.enrolment = std::move(*enrolled);
  co_return made;
}

asio::awaitable<Result<Enrolment>> Accounts::revoke_robot(std::string robot_id, station::Author by) {
  recorder_.set_revoked(robot_id, true);
  auto job = [robot_id, by](AccountStore& store) { return store.revoke_robot(robot_id, by); };
  const auto revoked = co_await on_store(std::move(job));
  if (revoked) co_return revoked;
  if (revoked.error().code == ErrorCode::not_found) recorder_.set_revoked(robot_id, false);
  co_return std::unexpected{not_stored(revoked.error())};
}

asio::awaitable<Result<Enrolment>> Accounts::set_retired(std::string robot_id, bool retired, station::Author by) {
  auto job = [robot_id, retired, by](AccountStore& store) { return store.set_retired(robot_id, retired, by); };
  auto stored = co_await on_store(std::move(job));
  if (!stored && !retired) co_return std::unexpected{not_stored(stored.error())};
  co_return stored;
}

}  // namespace server::identity
