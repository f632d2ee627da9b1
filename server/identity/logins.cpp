// One attempt: throttle, queue, hash, compare.
#include "server/identity/logins.hpp"

#include <spdlog/spdlog.h>

namespace server::identity {
namespace asio = boost::asio;

namespace {

constexpr microseconds kBusyRetry{std::chrono::seconds{2}};

std::unexpected<LoginRefusal> refuse(ErrorCode code, const char* detail, const char* reason, microseconds retry_after) {
  return std::unexpected{LoginRefusal{{code, detail, reason}, retry_after}};
}

// One of an address that waits; the address is forgotten with its last one.
class Waiting {
 public:
  Waiting(std::map<std::string, std::size_t>& addresses, std::string address)
      : addresses_{addresses}, address_{std::move(address)} {
    ++addresses_[address_];
  }
  ~Waiting() {
    const auto mine = addresses_.find(address_);
    if (--mine->second == 0) addresses_.erase(mine);
  }
  Waiting(const Waiting&) = delete;
  Waiting& operator=(const Waiting&) = delete;

 private:
  std::map<std::string, std::size_t>& addresses_;
  std::string address_;
};

}  // namespace

asio::awaitable<std::expected<std::string, LoginRefusal>> Logins::log_in(LoginAttempt attempt) {
  const microseconds wait = throttle_.wait(attempt.user, attempt.peer, clock_.steady_us());
  if (wait.count() > 0) {
    accounts_.on_refused_sign_in(attempt.user, attempt.peer, "throttled");
    co_return refuse(ErrorCode::unavailable, "too many attempts have failed; wait before the next one", "throttled",
                     wait);
  }
  const std::string network = config::network_of(attempt.peer);
  const auto of_address = waiting_of_address_.find(network);
  const bool address_waits = of_address != waiting_of_address_.end() && of_address->second >= kMaxWaitingOfAddress;
  if (waiting_ >= kMaxWaitingLogins || address_waits) {
    co_return refuse(ErrorCode::unavailable, "too many are signing in just now; try again", "busy", kBusyRetry);
  }
  const runtime::Counted counted{waiting_};
  const Waiting waiting{waiting_of_address_, network};
  throttle_.on_attempt(attempt.user, attempt.peer, clock_.steady_us());
  const bool right = co_await is_right(attempt);
  if (!right) {
    spdlog::warn("a sign-in from {} failed", attempt.peer);
    accounts_.on_refused_sign_in(attempt.user, attempt.peer, "wrong_credentials");
    co_return refuse(ErrorCode::unauthorized, "the user or the password is wrong", "wrong_credentials",
                     microseconds{0});
  }
  throttle_.on_success(attempt.user, attempt.peer);
  co_return accounts_.open_session(attempt.user, attempt.peer, attempt.agent);
}

asio::awaitable<bool> Logins::is_right(const LoginAttempt& attempt) {
  if (attempt.password.size() > runtime::kMaxPasswordBytes) co_return false;
  const User* user = accounts_.find_user(attempt.user);
  const std::string stored = user == nullptr ? std::string{} : user->password_hash;
  ++hashes_made_;
  auto job = [password = attempt.password, stored, cost = cost_] {
    if (!stored.empty()) return runtime::is_password(password, stored);
    hash_password(password, cost);  // an unknown user takes as long
    return false;
  };
  const bool right = co_await worker_.run(std::move(job));
  if (!right) co_return false;
  user = accounts_.find_user(attempt.user);  // as it is now
  co_return user != nullptr && !user->disabled && user->password_hash == stored;
}

asio::awaitable<Result<std::string>> Logins::hash(std::string password) {
  if (auto checked = check_password(password); !checked) co_return std::unexpected{checked.error()};
  if (waiting_ >= kMaxWaitingLogins) co_return fail(ErrorCode::unavailable, "too many are signing in just now", "busy");
  const runtime::Counted counted{waiting_};
  ++hashes_made_;
  auto job = [password = std::move(password), cost = cost_] { return hash_password(password, cost); };
  co_return co_await worker_.run(std::move(job));
}

}  // namespace server::identity
