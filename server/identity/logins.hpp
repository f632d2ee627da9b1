// Signing in with a password: Argon2id on a worker of its own, one at a time, behind a throttle and a bounded queue.
//
// An unknown user, a disabled one and a wrong password cost the same time and get the same answer. Loop thread; the
// accounts outlive it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <cstdint>
#include <expected>
#include <map>
#include <string>

#include "server/identity/accounts.hpp"
#include "server/identity/login_throttle.hpp"
#include "server/runtime/worker.hpp"

namespace server::identity {

inline constexpr std::size_t kMaxWaitingLogins = 8;
inline constexpr std::size_t kMaxWaitingOfAddress = 2;

struct LoginAttempt {
  std::string user;
  std::string password;
  std::string peer;   // the address, without port
  std::string agent;  // what the browser says it is
};

struct LoginRefusal {
  Error error;
  microseconds retry_after{0};  // 0: at once, with something else
};

class Logins {
 public:
  Logins(runtime::Clock& clock, Accounts& accounts, runtime::PasswordCost cost)
      : clock_{clock}, accounts_{accounts}, cost_{cost} {}

  // The secret of a new session, for its cookie. unauthorized: user or password is wrong; unavailable: after so long.
  boost::asio::awaitable<std::expected<std::string, LoginRefusal>> log_in(LoginAttempt attempt);

  // For a user's new password. invalid: its length; unavailable: too many wait.
  boost::asio::awaitable<Result<std::string>> hash(std::string password);

  const runtime::WorkerThread& worker() const { return worker_; }
  std::uint64_t hashes_made() const { return hashes_made_; }

 private:
  boost::asio::awaitable<bool> is_right(const LoginAttempt& attempt);

  runtime::Clock& clock_;
  Accounts& accounts_;
  runtime::PasswordCost cost_;
  LoginThrottle throttle_;
  std::map<std::string, std::size_t> waiting_of_address_;  // at most kMaxWaitingLogins of them
  std::size_t waiting_ = 0;
  std::uint64_t hashes_made_ = 0;
  runtime::WorkerThread worker_{"passwords", 10};
};

}  // namespace server::identity
