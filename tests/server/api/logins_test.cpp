// Signing in with a password, and attempts to guess one.
#include "server/identity/accounts.hpp"
#include "server/identity/login_throttle.hpp"

#include "server/identity/logins.hpp"
#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

using std::chrono::seconds;

TEST(Secrets, AreComparedToTheirLastByteWhereverTheyDiffer) {
  const runtime::SecretHash hash = runtime::hash_of("a secret");
  EXPECT_TRUE(runtime::same(hash, runtime::hash_of("a secret")));
  for (std::size_t i = 0; i < hash.size(); ++i) {
    runtime::SecretHash other = hash;
    other[i] ^= 1U;
    EXPECT_FALSE(runtime::same(hash, other)) << i;
  }
}

// The search takes as many steps whether the first, the last or none is the right one.
TEST(Secrets, AreLookedForAmongAllOfThem) {
  struct Counted {
    runtime::SecretHash hash{};
  };
  struct Counting {
    std::vector<Counted> entries;
    mutable int steps = 0;
    struct Iterator {
      Counting* of;
      std::size_t at;
      Counted& operator*() const {
        ++of->steps;
        return of->entries[at];
      }
      Iterator& operator++() {
        ++at;
        return *this;
      }
      bool operator!=(const Iterator& other) const { return at != other.at; }
    };
    Iterator begin() { return {this, 0}; }
    Iterator end() { return {this, entries.size()}; }
  };
  Counting all;
  for (int i = 0; i < 50; ++i) all.entries.push_back({runtime::hash_of(std::to_string(i))});
  for (const char* wanted : {"0", "25", "49", "nobody's"}) {
    all.steps = 0;
    const Counted* found = runtime::find_secret(all, runtime::hash_of(wanted));
    EXPECT_EQ(found != nullptr, std::string{wanted} != "nobody's");
    EXPECT_EQ(all.steps, 50) << wanted;
  }
}

TEST(Secrets, PasswordsAreArgon2idWithASaltOfTheirOwn) {
  const std::string hash = hash_password("correct horse", kCheapPasswords);
  EXPECT_TRUE(hash.starts_with("$argon2id$v=19$")) << hash;
  EXPECT_NE(hash, hash_password("correct horse", kCheapPasswords));
  EXPECT_TRUE(runtime::is_password("correct horse", hash));
  EXPECT_FALSE(runtime::is_password("correct hors", hash));
  EXPECT_FALSE(runtime::is_password("", hash));
  EXPECT_FALSE(runtime::is_password("correct horse", "not a hash"));
  EXPECT_TRUE(runtime::hash_password("x", {}).starts_with("$argon2id$v=19$m=65536,t=2,p=1$")) << "64 MiB, 2 passes";
}

constexpr identity::LoginThrottle::Key kKey{1, 2, 3};  // under which none of the names below share a place

TEST(LoginThrottle, DoublesTheWaitUpToALimitAndForgets) {
  identity::LoginThrottle throttle{kKey};
  std::int64_t now_us = 1'000'000;
  for (int i = 1; i < identity::LoginThrottle::kFreeOfUser; ++i) {
    throttle.on_attempt("anna", "10.0.0." + std::to_string(i), now_us);
    EXPECT_EQ(throttle.wait("anna", "10.0.0.99", now_us), seconds{0}) << i;
  }
  for (const int wait_s : {1, 2, 4, 8, 16, 30, 30, 30}) {
    throttle.on_attempt("anna", "10.0.0.77", now_us);
    EXPECT_EQ(throttle.wait("anna", "10.0.0.99", now_us), seconds{wait_s});
    now_us += seconds{wait_s}.count() * 1'000'000;
    EXPECT_EQ(throttle.wait("anna", "10.0.0.99", now_us), seconds{0});
  }
  EXPECT_EQ(throttle.wait("otto", "10.0.0.99", now_us), seconds{0}) << "of another name and place";
  throttle.on_attempt("anna", "10.0.0.99", now_us);
  EXPECT_EQ(throttle.wait("anna", "10.0.0.99", now_us), seconds{30});
  throttle.on_success("anna", "10.0.0.99");
  EXPECT_EQ(throttle.wait("anna", "10.0.0.99", now_us), seconds{0});
  for (int i = 0; i < 20; ++i) throttle.on_attempt("anna", "10.0.0.98", now_us);
  now_us += identity::LoginThrottle::kForgetAfter.count();
  throttle.on_attempt("anna", "10.0.0.98", now_us);
  EXPECT_EQ(throttle.wait("anna", "10.0.0.98", now_us), seconds{0}) << "forgotten";
}

TEST(LoginThrottle, AnAddressWaitsLongerAndOneGoodAccountDoesNotOpenTheOthers) {
  identity::LoginThrottle throttle{kKey};
  std::int64_t now_us = 1'000'000;
  for (int i = 0; i < 9; ++i) throttle.on_attempt("user" + std::to_string(i), "10.0.0.1", now_us);
  throttle.on_attempt("mine", "10.0.0.1", now_us);
  throttle.on_success("mine", "10.0.0.1");
  EXPECT_EQ(throttle.wait("another", "10.0.0.1", now_us), seconds{0});
  throttle.on_attempt("another", "10.0.0.1", now_us);
  EXPECT_EQ(throttle.wait("mine", "10.0.0.1", now_us), seconds{1});
  for (int i = 0; i < 30; ++i) throttle.on_attempt("user" + std::to_string(i), "10.0.0.1", now_us);
  EXPECT_EQ(throttle.wait("mine", "10.0.0.1", now_us), std::chrono::minutes{15});
  EXPECT_EQ(throttle.wait("mine", "10.0.0.2", now_us), seconds{0});
}

TEST(LoginThrottle, ANetworkOfIpv6IsOneAddress) {
  EXPECT_EQ(config::network_of("2001:db8:1:2:3:4:5:6"), config::network_of("2001:db8:1:2:ffff::1"));
  EXPECT_NE(config::network_of("2001:db8:1:2::1"), config::network_of("2001:db8:1:3::1"));
  EXPECT_EQ(config::network_of("::ffff:10.0.0.1"), "::ffff:10.0.0.1");
  EXPECT_EQ(config::network_of("10.0.0.1"), "10.0.0.1");
  EXPECT_EQ(config::network_of(""), "");
}

class LoginsTest : public ApiTest {
 protected:
  LoginsTest() { EXPECT_EQ(ask("POST", "/api/v1/users", user("anna", "operator")).status, 201); }
  static json user(const std::string& name, const std::string& role) {
    return {{"name", name}, {"role", role}, {"password", "correct horse"}};
  }
  Answered log_in(const std::string& name, const std::string& password) {
    return ask("POST", "/api/v1/login", {{"user", name}, {"password", password}});
  }
  static std::string header(const Answered& answered, const std::string& name) {
    for (const auto& [key, value] : answered.response.headers) {
      if (key == name) return value;
    }
    return "";
  }
  static std::string secret_of(const Answered& answered) {
    const std::string cookie = header(answered, "Set-Cookie");
    return cookie.substr(cookie.find('=') + 1, cookie.find(';') - cookie.find('=') - 1);
  }
  std::uint64_t hashes() const { return logins().hashes_made(); }
};

TEST_F(LoginsTest, APasswordOpensASession) {
  const Answered in = log_in("anna", "correct horse");
  ASSERT_EQ(in.status, 200) << in.body;
  EXPECT_EQ(in.parsed(), (json{{"actor", "user:anna/session:1"},
                               {"user", "anna"},
                               {"role", "operator"},
                               {"scopes", "read,stop,record,command"}}));
  EXPECT_TRUE(header(in, "Set-Cookie").starts_with("rheonaut_session_fedcba9876543210="));
  EXPECT_EQ(accounts().caller_of_session(secret_of(in))->actor, "user:anna/session:1");
  EXPECT_EQ(ask("GET", "/api/v1/sessions").parsed()["sessions"][0]["peer"], "127.0.0.1");
  EXPECT_EQ(in.body.find(secret_of(in)), std::string::npos) << "no script of the page sees it";
}

TEST_F(LoginsTest, WrongUnknownAndDisabledGetOneAnswerForOnePrice) {
  EXPECT_EQ(ask("POST", "/api/v1/users", user("otto", "admin")).status, 201);
  EXPECT_EQ(ask("POST", "/api/v1/users/otto/change", {{"disabled", true}}).status, 200);
  std::set<std::string> answers;
  for (const auto& [name, password] : {std::pair{"anna", "wrong"}, {"nobody", "wrong"}, {"otto", "correct horse"}}) {
    const std::uint64_t before = hashes();
    const Answered refused = log_in(name, password);
    EXPECT_EQ(refused.status, 401);
    EXPECT_EQ(header(refused, "Set-Cookie"), "");
    EXPECT_EQ(hashes() - before, 1U) << name;
    answers.insert(refused.body);
  }
  EXPECT_EQ(answers.size(), 1U) << "which of them it was is not said";
}

TEST_F(LoginsTest, BodiesThatAreNoneAreRefused) {
  for (const char* body :
       {"", "[]", "{", R"({"user":"anna"})", R"({"user":"anna","password":7})",
        R"({"user":"anna","password":"x","more":1})", R"({"code":7})", R"({"user":"anna","code":"x"})"}) {
    const Answered refused = ask("POST", "/api/v1/login", json::parse(body, nullptr, false));
    EXPECT_GE(refused.status, 400) << body;
    EXPECT_LT(refused.status, 500) << body;
  }
  EXPECT_EQ(log_in("anna", std::string(1000, 'x')).status, 401);
}

TEST_F(LoginsTest, TenThousandBadLoginsCostAFewHashesAndSignNobodyOut) {
  const Answered in = log_in("anna", "correct horse");
  ASSERT_EQ(in.status, 200);
  const std::uint64_t before = hashes();
  std::map<int, int> statuses;
  for (int i = 0; i < 10'000; ++i) {
    const Answered refused = log_in(i % 2 == 0 ? "anna" : "user" + std::to_string(i), "guess");
    ++statuses[refused.status];
    if (refused.status != 429) continue;
    EXPECT_GE(std::stoi(header(refused, "Retry-After")), 1);
    EXPECT_EQ(refused.parsed()["reason"], "throttled");
  }
  EXPECT_EQ(statuses[401] + statuses[429], 10'000);
  EXPECT_LE(hashes() - before, static_cast<std::uint64_t>(identity::LoginThrottle::kFreeOfAddress));
  EXPECT_EQ(accounts().sessions().size(), 1U);
  // Who is signed in goes on, and stops.
  scopes = accounts().caller_of_session(secret_of(in))->scopes;
  connect_robot();
  auto stopping = begin("POST", "/api/v1/robots/r1/emergency-stop");
  ASSERT_TRUE(clock.run_until([&] { return !robot->commands().empty(); }, 1s));
  robot->acknowledge(robot->commands().at(0), rheonaut_COMMAND_RESULT_ACCEPTED, 9);
  EXPECT_EQ(end(stopping).status, 200);
  // The right password has to wait as well, and no longer than the answer said.
  const Answered throttled = log_in("anna", "correct horse");
  ASSERT_EQ(throttled.status, 429);
  clock.run_for(seconds{std::stoi(header(throttled, "Retry-After"))});
  EXPECT_EQ(log_in("anna", "correct horse").status, 200);
}

TEST_F(LoginsTest, FewWaitAtATimeAndFewerOfOneAddress) {
  struct Asking {
    std::string peer;
    std::optional<std::expected<std::string, identity::LoginRefusal>> end;
  };
  std::vector<Asking> all;
  for (int i = 0; i < 20; ++i) all.push_back({i < 5 ? "10.0.0.1" : "10.0.1." + std::to_string(i), {}});
  const auto attempt = [](identity::Logins& logins, Asking& asking, std::string name) -> boost::asio::awaitable<void> {
    identity::LoginAttempt attempt{std::move(name), "guess", asking.peer, ""};
    asking.end = co_await logins.log_in(std::move(attempt));
  };
  identity::Logins logins{clock, accounts(), kCheapPasswords};
  clock.add_worker(logins.worker());
  for (std::size_t i = 0; i < all.size(); ++i) {
    tasks.spawn("attempt", attempt(logins, all[i], "user" + std::to_string(i)));
  }
  clock.settle();
  clock.remove_worker(logins.worker());
  std::size_t busy_of_one = 0;
  std::size_t hashed = 0;
  for (const Asking& asking : all) {
    ASSERT_TRUE(asking.end);
    ASSERT_FALSE(asking.end->has_value());
    if (asking.end->error().error.reason == "busy" && asking.peer == "10.0.0.1") ++busy_of_one;
    if (asking.end->error().error.reason == "wrong_credentials") ++hashed;
  }
  EXPECT_EQ(busy_of_one, 5 - identity::kMaxWaitingOfAddress);
  EXPECT_EQ(hashed, identity::kMaxWaitingLogins);
  EXPECT_EQ(logins.hashes_made(), identity::kMaxWaitingLogins);
}

TEST_F(LoginsTest, EachUserHasAFewSessionsAndTakesNobodyElsesPlace) {
  const std::string of_link = accounts().open_session("", "", "");
  std::vector<std::string> secrets;
  for (std::size_t i = 0; i <= identity::kMaxSessionsOfUser; ++i) {
    secrets.push_back(secret_of(log_in("anna", "correct horse")));
    clock.run_for(1s);
  }
  EXPECT_FALSE(accounts().caller_of_session(secrets.front()));
  EXPECT_TRUE(accounts().caller_of_session(secrets.back()));
  EXPECT_TRUE(accounts().caller_of_session(of_link));
}

TEST_F(LoginsTest, ANewPasswordEndsTheSessionsAndTheOldPassword) {
  const std::string secret = secret_of(log_in("anna", "correct horse"));
  EXPECT_EQ(ask("POST", "/api/v1/users/anna/change", {{"password", "short"}}).status, 422);
  EXPECT_TRUE(accounts().caller_of_session(secret));
  EXPECT_EQ(ask("POST", "/api/v1/users/anna/change", {{"password", "battery staple"}}).status, 200);
  EXPECT_FALSE(accounts().caller_of_session(secret));
  EXPECT_EQ(log_in("anna", "correct horse").status, 401);
  EXPECT_EQ(log_in("anna", "battery staple").status, 200);
}

}  // namespace
}  // namespace server
