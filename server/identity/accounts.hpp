// Users, API tokens and sessions of pages: in memory for requests, in the database for the next start.
//
// Looking somebody up is synchronous and touches no disk. What gives rights is stored before it is in force; what takes
// rights away is in force at once, and then stored. SAFETY: a full or failing disk refuses nobody who is signed in:
// sessions, and when tokens were last used, are written behind, and again until it works.
// Loop thread; SQL on the recorder's disk thread. Everything it is given outlives it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <filesystem>
#include <list>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/identity/account_store.hpp"
#include "server/identity/rights.hpp"
#include "server/identity/sessions.hpp"
#include "server/storage/ingest/recorder.hpp"

namespace server::storage {
class RemovalClock;
}

namespace server::identity {

inline constexpr std::int64_t kMaxTokenDays = 3650;

struct TokenRequest {
  std::string name;
  Scopes scopes;
  std::int64_t days = 0;  // 0: it does not run out
  std::string owner;
};

struct NewToken {
  ApiToken token;
  std::string secret;  // nobody can read it again
};

struct NewEnrolment {
  Enrolment enrolment;
  std::string secret;
};

class Accounts {
 public:
  // Reads the database, which is open, and takes over the sessions of an older station's `rheonaut.sessions`. Throws
  // when the database cannot be read.
  Accounts(boost::asio::io_context& loop, runtime::Clock& clock, storage::Recorder& recorder,
           const storage::RemovalClock& removal_clock, const std::filesystem::path& data_dir);

  Rights& rights() { return rights_; }

  // Writes what is to be written, until cancelled.
  boost::asio::awaitable<void> run();
  // Ends the rights that run out, and what acts without a right that is there, until cancelled.
  boost::asio::awaitable<void> watch_rights();

  std::optional<Caller> caller_of_token(const std::string& secret);
  std::optional<Caller> caller_of_session(const std::string& secret);  // which is renewed

  // The secret of a new session, for its cookie.
  std::string open_session(const std::string& user, const std::string& peer, const std::string& agent);
  // It has ended in any case. unavailable: the disk cannot store that now. not_found: there is no such session.
  boost::asio::awaitable<Result<void>> end_session(std::uint64_t number, station::Author by);
  // The audit has the name of a user that exists; another name may be a password typed in the wrong field.
  void on_refused_sign_in(const std::string& user, const std::string& peer, const char* reason);
  const std::list<Sessions::Open>& sessions() const { return sessions_.all(); }

  const User* find_user(const std::string& name) const;  // null: there is none
  const std::map<std::string, User>& users() const { return users_; }
  // unavailable: the disk cannot be written now. Else what AccountStore says. `by.at_us` is when it is done.
  boost::asio::awaitable<Result<User>> add_user(User user, station::Author by);
  boost::asio::awaitable<Result<User>> change_user(std::string name, UserChange change, station::Author by);
  boost::asio::awaitable<Result<void>> remove_user(std::string name, station::Author by);

  // The account that an actor belongs to: the user ("user:anna") of a token or a page that has one; else the actor
  // itself.
  std::string account_of(const std::string& actor) const;
  bool is_account(const std::string& account) const;  // somebody may sign in as, or use, it now

  std::vector<ApiToken> tokens() const;
  boost::asio::awaitable<Result<NewToken>> add_token(TokenRequest request, station::Author by);
  boost::asio::awaitable<Result<ApiToken>> revoke_token(std::string name, station::Author by);
  // A token past its time is refused whatever the clock says afterwards, until this; once the clock has stood by that
  // for a day (RemovalClock) it is revoked.
  boost::asio::awaitable<Result<ApiToken>> revive_token(std::string name, station::Author by);

  boost::asio::awaitable<Result<std::vector<Enrolment>>> enrolments();
  boost::asio::awaitable<Result<NewEnrolment>> enrol(std::string robot_id, station::Author by);
  // The robot is refused from now on; the caller ends its connection.
  boost::asio::awaitable<Result<Enrolment>> revoke_robot(std::string robot_id, station::Author by);
  // Only stores it. The caller notifies the station: before, when a robot returns to use; after, when it retires.
  boost::asio::awaitable<Result<Enrolment>> set_retired(std::string robot_id, bool retired, station::Author by);

 private:
  struct Token : ApiToken {
    std::shared_ptr<Standing> standing;
    bool is_expiry_stored = false;
  };

  Caller caller(std::string actor, const std::string& user, Scopes scopes, std::shared_ptr<Standing> standing) const;
  template <class Job>
  boost::asio::awaitable<std::invoke_result_t<Job, AccountStore&>> on_store(Job job);
  boost::asio::awaitable<bool> save();
  boost::asio::awaitable<bool> store_expired();
  bool is_past(const ApiToken& token) const;
  void note_expiry(Token& token);
  void end_token(Token& token, std::int64_t utc_us);
  void end_expired();
  void end_what_has_no_right() const;
  std::string lacks(const std::string& actor, Scope needed) const;
  void end_pages_of(const std::string& user, const std::string& by);
  std::int64_t next_look_us() const;
  void end_right_of(const std::string& actor, std::string why) const;
  void end_rights_of(const std::string& user, Scopes left, std::string why) const;
  bool is_of(const std::string& actor, const std::string& user) const;
  void renew_standing(const std::string& user);
  void note(station::Author by, const char* action, std::string subject, std::string detail, bool can_flood);

  boost::asio::io_context& loop_;
  runtime::Clock& clock_;
  storage::Recorder& recorder_;
  const storage::RemovalClock& removal_clock_;
  std::filesystem::path old_sessions_file_;
  std::map<std::string, User> users_;
  std::list<Token> tokens_;
  Sessions sessions_;
  Rights rights_;
  std::uint64_t token_uses_ = 0;  // grows with what is worth to be stored of tokens
  std::uint64_t saved_revision_ = 0;
  bool save_failed_ = false;
  runtime::Signal changed_;
};

}  // namespace server::identity
