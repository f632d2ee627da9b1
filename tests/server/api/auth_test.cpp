// Token, login codes, sessions, and who is let in.
#include <fmt/format.h>
#include <sys/stat.h>

#include <fstream>

#include "server/http/request_guard.hpp"
#include "server/identity/accounts.hpp"
#include "server/identity/auth.hpp"
#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

constexpr std::uint64_t kStore = 0xfedcba9876543210;

// Credentials over the database of a station: made again, they are those of a station that was started again.
struct Credentials {
  Credentials(boost::asio::io_context& loop, runtime::Clock& clock, storage::RecordingParts& recording,
              const std::filesystem::path& folder)
      : accounts{loop, clock, recording.recorder, recording.removal_clock, folder},
        auth{loop, clock, accounts, folder, kStore} {}
  std::string log_in() { return *auth.log_in(auth.new_login_code(), "127.0.0.1", "a browser"); }
  std::string actor(const std::string& session) {
    const auto caller = auth.caller_of_session(session);
    return caller ? caller->actor : "";
  }

  identity::Accounts accounts;
  identity::Auth auth;
};

class AuthTest : public ApiTest {
 protected:
  ~AuthTest() override {
    tasks.stop();
    clock.settle();
  }
  Credentials* start() {
    started.push_back(std::make_unique<Credentials>(loop, clock, recording, home.path()));
    return started.back().get();
  }
  // Lets it store what there is to store, from now on.
  void store(Credentials* station) {
    tasks.spawn("accounts", station->accounts.run());
    clock.settle();
  }
  std::string token() const {
    std::ifstream in{file};
    std::string text;
    std::getline(in, text);
    return text;
  }
  unsigned mode() const {
    struct stat status{};
    stat(file.c_str(), &status);
    return status.st_mode & 0777U;
  }
  void write(const std::string& text) const { std::ofstream{file} << text << "\n"; }

  TemporaryFolder home;
  std::vector<std::unique_ptr<Credentials>> started;
  std::filesystem::path file = home.path() / "rheonaut.token";
};

TEST_F(AuthTest, MakesATokenThatOnlyItsOwnerReads) {
  auto* const station = start();
  EXPECT_EQ(token().size(), 43U);  // 256 bits
  EXPECT_EQ(mode(), 0600U);
  EXPECT_EQ(station->auth.caller_of_token(token())->actor, "token:local");
  EXPECT_EQ(station->auth.caller_of_token(token())->role(), identity::Role::admin);
  EXPECT_FALSE(station->auth.caller_of_token(""));
  EXPECT_FALSE(station->auth.caller_of_token(token() + "x"));
  EXPECT_FALSE(std::filesystem::exists(file.string() + ".new"));
}

TEST_F(AuthTest, KeepsAValidTokenAndProtectsIt) {
  start();
  const std::string before = token();
  chmod(file.c_str(), 0644);
  start();
  EXPECT_EQ(token(), before);
  EXPECT_EQ(mode(), 0600U);
}

TEST_F(AuthTest, ReplacesWhatIsNoToken) {
  for (const char* text : {"", "short", "////////////////////////////////////////////////"}) {
    write(text);
    auto* const station = start();
    EXPECT_EQ(token().size(), 43U) << text;
    EXPECT_TRUE(station->auth.caller_of_token(token()));
    EXPECT_EQ(mode(), 0600U);
  }
}

TEST_F(AuthTest, SaysWhichFileItCannotWrite) {
  identity::Accounts accounts{loop, clock, recorder, recording.removal_clock, home.path()};
  try {
    const identity::Auth auth{loop, clock, accounts, home.path() / "missing", kStore};
    FAIL();
  } catch (const std::exception& error) {
    EXPECT_NE(std::string{error.what()}.find("rheonaut.token"), std::string::npos) << error.what();
  }
}

TEST_F(AuthTest, ACodeOpensOneSessionOnce) {
  auto* const station = start();
  identity::Auth& auth = station->auth;
  const std::string code = auth.new_login_code();
  EXPECT_FALSE(auth.log_in("guess", "", ""));
  const auto session = auth.log_in(code, "", "");
  ASSERT_TRUE(session);
  EXPECT_FALSE(auth.log_in(code, "", ""));
  EXPECT_EQ(station->actor(*session), "session:1");
  EXPECT_EQ(auth.caller_of_session(*session)->role(), identity::Role::admin);
  EXPECT_FALSE(auth.caller_of_session(code));
  EXPECT_FALSE(auth.caller_of_token(*session));
}

TEST_F(AuthTest, ASessionOutlivesTheStationAndItsNumberIsNotGivenTwice) {
  auto* first = start();
  const std::string session = first->log_in();
  const std::string other = first->log_in();
  const station::Author by;
  const auto end_second = [&]() -> boost::asio::awaitable<void> { co_await first->accounts.end_session(2, by); };
  tasks.spawn("the end of a session", end_second());
  store(first);
  auto* second = start();
  EXPECT_EQ(second->actor(session), "session:1");
  EXPECT_EQ(second->actor(other), "");
  EXPECT_EQ(second->actor(second->log_in()), "session:3");
  clock.skip(12h);
  EXPECT_EQ(start()->actor(session), "");
}

TEST_F(AuthTest, TheSessionsOfAnOlderStationAreTakenOverOnce) {
  const std::filesystem::path old = home.path() / "rheonaut.sessions";
  const std::string secret = runtime::random_secret();
  std::string hex;
  for (const unsigned char byte : runtime::hash_of(secret)) hex += fmt::format("{:02x}", byte);
  const std::int64_t end_us = clock.utc_us() + 3'600'000'000;
  std::ofstream{old} << "7 " << end_us << ' ' << hex << "\n8 " << end_us << " zz\n";
  auto* station = start();
  EXPECT_EQ(station->actor(secret), "session:7");
  EXPECT_TRUE(std::filesystem::exists(old)) << "until it is stored";
  store(station);
  EXPECT_FALSE(std::filesystem::exists(old));
  EXPECT_EQ(start()->actor(secret), "session:7");
}

TEST_F(AuthTest, ADamagedSessionFileLetsNobodyIn) {
  std::ofstream{home.path() / "rheonaut.sessions"} << "1 99999999999999999 zz\n2 99999999999999999\n";
  EXPECT_EQ(start()->actor(""), "");
}

TEST_F(AuthTest, CodesAndSessionsEndInTime) {
  auto* const station = start();
  const std::string late = station->auth.new_login_code();
  clock.skip(10min);
  EXPECT_FALSE(station->auth.log_in(late, "", ""));
  const std::string session = station->log_in();
  clock.skip(12h);
  EXPECT_EQ(station->actor(session), "");
}

TEST_F(AuthTest, ASessionThatHasEndedStaysSoWhenTheClockGoesBack) {
  auto* const station = start();
  const std::string closed = station->log_in(), open = station->log_in();
  const auto page = station->auth.caller_of_session(open);
  clock.step_utc(192h);
  EXPECT_EQ(station->actor(closed), "");
  EXPECT_NE(station->actor(open), "") << "an operator has it open";
  clock.step_utc(-192h);
  EXPECT_EQ(station->actor(closed), "");
  EXPECT_NE(station->actor(open), "");
  EXPECT_LE(station->accounts.sessions().back().ends_at_us, clock.utc_us() + 12 * 3'600'000'000LL);
}

TEST_F(AuthTest, ASessionInUseIsRenewedAndStoredAtMostOnceAnHour) {
  auto* station = start();
  const std::string session = station->log_in();
  store(station);
  const auto stored_end_us = [this] {
    return SQLite::Database{recorder.path().string()}.execAndGet("SELECT max(ends_at_us) FROM page_session").getInt64();
  };
  const std::int64_t first_us = stored_end_us();
  clock.skip(59min);
  EXPECT_NE(station->actor(session), "");
  clock.settle();
  EXPECT_EQ(stored_end_us(), first_us);
  clock.skip(12h - 1s);
  EXPECT_NE(station->actor(session), "");
  clock.settle();
  EXPECT_GT(stored_end_us(), first_us);
  clock.skip(12h - 1s);
  auto* restarted = start();
  EXPECT_NE(restarted->actor(session), "");
  clock.skip(12h);
  EXPECT_EQ(restarted->actor(session), "");
}

TEST_F(AuthTest, AnOpenPageUsesItsSession) {
  auto* station = start();
  const std::string session = station->log_in();
  const auto page = station->auth.caller_of_session(session);  // as /live holds it
  store(station);
  for (int i = 0; i < 3; ++i) {
    clock.skip(11h);
    clock.run_for(2min);
  }
  EXPECT_FALSE(page->standing->ended());
  EXPECT_NE(station->actor(session), "");
}

TEST_F(AuthTest, ForgetsTheOldestWhenThereAreTooMany) {
  auto* const station = start();
  identity::Auth& auth = station->auth;
  const std::string first_code = auth.new_login_code();
  for (std::size_t i = 0; i < identity::kMaxLoginCodes; ++i) auth.new_login_code();
  EXPECT_FALSE(auth.log_in(first_code, "", ""));
  const std::string first = station->log_in();
  for (std::size_t i = 0; i < identity::kMaxSessionsOfLinks; ++i) station->log_in();
  EXPECT_EQ(station->actor(first), "");
  EXPECT_EQ(station->accounts.sessions().size(), identity::kMaxSessionsOfLinks);
}

TEST_F(AuthTest, EachStationHasACookieOfItsOwnName) {
  auto* const station = start();
  EXPECT_EQ(station->auth.cookie_name(), "rheonaut_session_fedcba9876543210");
  EXPECT_EQ(
      station->auth.cookie("x", false).find("rheonaut_session_fedcba9876543210=x; HttpOnly; SameSite=Strict; Path=/"),
      0U);
  const identity::Auth other{loop, clock, station->accounts, home.path(), kStore + 1};
  EXPECT_NE(other.cookie_name(), station->auth.cookie_name());
}

class RequestGuardTest : public AuthTest {
 protected:
  http::Request request(const std::string& method, const std::string& target) const {
    http::Request made;
    made.method = method;
    made.target = target;
    made.headers["host"] = "localhost:8080";
    return made;
  }
  http::Request with_token(const std::string& method, const std::string& target) const {
    http::Request made = request(method, target);
    made.headers["authorization"] = "Bearer " + token();
    return made;
  }
  http::Request with_cookie(const std::string& method, const std::string& target) const {
    http::Request made = request(method, target);
    made.headers["cookie"] = "theme=dark; rheonaut_session_fedcba9876543210=" + session;
    return made;
  }
  int status(const http::Request& asked) const {
    const auto admitted = guard.admit(asked);
    return admitted ? 200 : admitted.error().status;
  }

  Credentials* station = start();
  http::RequestGuard guard{station->auth, {"Station.Lab", "192.168.1.5"}};
  std::string session = station->log_in();
};

TEST_F(RequestGuardTest, NamesWhoAsks) {
  EXPECT_EQ(guard.admit(with_token("GET", "/api/v1/robots"))->actor, "token:local");
  EXPECT_EQ(guard.admit(with_cookie("GET", "/api/v1/robots"))->actor, "session:1");
  EXPECT_EQ(guard.admit(request("GET", "/"))->actor, "");
}

TEST_F(RequestGuardTest, TakesItsOwnCookieAndNotThatOfAnotherStationOrAnOlderOne) {
  http::Request asked = request("GET", "/api/v1/robots");
  asked.headers["cookie"] = "rheonaut_session=" + session;
  EXPECT_EQ(status(asked), 401);
  asked.headers["cookie"] = "rheonaut_session_fedcba9876543211=" + session;
  EXPECT_EQ(status(asked), 401);
  asked.headers["cookie"] = "rheonaut_session_fedcba9876543211=other; rheonaut_session_fedcba9876543210=" + session;
  EXPECT_EQ(status(asked), 200);
}

TEST_F(RequestGuardTest, EverythingWithDataNeedsACredential) {
  for (const char* target : {"/api/v1/robots", "/api/v1/nothing", "/api/v1/openapi.yaml", "/live", "/%61pi/v1/robots",
                             "/%6cive", "/api/v1/robots?x=/login", "/api/v1/login", "/api/v1/login/x"}) {
    EXPECT_EQ(status(request("GET", target)), 401) << target;
  }
  for (const char* target : {"/api/v1/emergency-stop", "/", "/api/v1/login/x", "/api/v1/logout", "/login"}) {
    EXPECT_EQ(status(request("POST", target)), 401) << target;
  }
  EXPECT_EQ(status(request("POST", "/api/v1/login")), 200);
  for (const char* target : {"/", "/login?code=x", "/assets/main.js"}) {
    EXPECT_EQ(status(request("GET", target)), 200) << target;
  }
  http::Request wrong = with_cookie("GET", "/api/v1/robots");
  for (const char* credential : {"Bearer wrong", "Bearer ", "Basic abc", "Bearer"}) {
    wrong.headers["authorization"] = credential;
    EXPECT_EQ(status(wrong), 401) << credential;
  }
}

TEST_F(RequestGuardTest, AWrongTokenIsToldFromNone) {
  const auto reason = [this](const http::Request& asked) {
    return nlohmann::json::parse(guard.admit(asked).error().body)["reason"].get<std::string>();
  };
  const auto challenge = [this](const http::Request& asked) {
    const http::Response refused = guard.admit(asked).error();
    for (const auto& [name, value] : refused.headers) {
      if (name == "WWW-Authenticate") return value;
    }
    return std::string{};
  };
  http::Request asked = request("GET", "/api/v1/robots");
  EXPECT_EQ(reason(asked), "no_credential");
  EXPECT_EQ(challenge(asked), "Bearer");
  asked.headers["authorization"] = "Basic abc";
  EXPECT_EQ(reason(asked), "no_credential");
  asked.headers["authorization"] = "Bearer wrong";
  EXPECT_EQ(reason(asked), "wrong_token");
  EXPECT_EQ(challenge(asked), R"(Bearer error="invalid_token")");
  http::Request with_both = with_cookie("GET", "/api/v1/robots");
  with_both.headers["authorization"] = "Bearer wrong";
  EXPECT_EQ(reason(with_both), "wrong_token") << "a cookie does not make it good";
  http::Request of_ended = request("GET", "/api/v1/robots");
  of_ended.headers["cookie"] = "rheonaut_session_fedcba9876543210=ended";
  EXPECT_EQ(reason(of_ended), "no_credential");
}

TEST_F(RequestGuardTest, NoRoleHelpsARequestOfAnotherOrigin) {
  http::Request post = with_cookie("POST", "/api/v1/emergency-stop");
  post.headers["origin"] = "http://evil.example";
  const auto problem = nlohmann::json::parse(guard.admit(post).error().body);
  EXPECT_EQ(problem["reason"], "wrong_origin");
  EXPECT_TRUE(problem.at("needs").is_null());
}

TEST_F(RequestGuardTest, AnswersOnlyToItsOwnNames) {
  http::Request asked = with_token("GET", "/api/v1/robots");
  for (const char* host : {"localhost", "LOCALHOST:1", "127.0.0.1:8080", "127.9.9.9", "[::1]:8080", "station.lab:8080",
                           "STATION.LAB", "192.168.1.5"}) {
    asked.headers["host"] = host;
    EXPECT_EQ(status(asked), 200) << host;
  }
  for (const char* host : {"", "evil.example", "localhost.evil.example", "192.168.1.6", "127.0.0.1.evil.example",
                           "station.lab, evil.example", "[::1", "@localhost"}) {
    asked.headers["host"] = host;
    EXPECT_EQ(status(asked), 421) << host;
  }
}

TEST_F(RequestGuardTest, RefusesOtherOriginsForChangesForSigningInAndForLive) {
  for (const char* origin : {"http://evil.example", "null", "http://localhost:8081", "https://localhost:8080"}) {
    http::Request post = with_token("POST", "/api/v1/emergency-stop");
    post.headers["origin"] = origin;
    EXPECT_EQ(status(post), 403) << origin;
    http::Request sign_in = request("POST", "/api/v1/login");
    sign_in.headers["origin"] = origin;
    EXPECT_EQ(status(sign_in), 403) << origin;
    http::Request live = with_cookie("GET", "/live");
    live.headers["origin"] = origin;
    EXPECT_EQ(status(live), 403) << origin;
  }
  http::Request own = with_cookie("GET", "/live");
  own.headers["origin"] = "http://localhost:8080";
  EXPECT_EQ(status(own), 200);
  EXPECT_EQ(status(with_cookie("GET", "/live")), 200);
}

TEST_F(RequestGuardTest, AChangeByCookieMustSayThatItComesFromTheStationsPage) {
  EXPECT_EQ(status(with_cookie("POST", "/api/v1/emergency-stop")), 403);
  http::Request post = with_cookie("POST", "/api/v1/emergency-stop");
  post.headers["sec-fetch-site"] = "cross-site";
  EXPECT_EQ(status(post), 403);
  post.headers["sec-fetch-site"] = "same-origin";
  EXPECT_EQ(status(post), 200);
  post.headers.erase("sec-fetch-site");
  post.headers["origin"] = "http://localhost:8080";
  EXPECT_EQ(status(post), 200);
  EXPECT_EQ(status(with_token("POST", "/api/v1/emergency-stop")), 200);
}

TEST_F(RequestGuardTest, ABodyMustBeJson) {
  for (http::Request post : {with_token("POST", "/api/v1/runs"), request("POST", "/api/v1/login")}) {
    post.body = "{}";
    EXPECT_EQ(status(post), 415);
    for (const char* type : {"application/json", "application/json; charset=utf-8", "Application/JSON"}) {
      post.headers["content-type"] = type;
      EXPECT_EQ(status(post), 200) << type;
    }
    for (const char* type : {"text/plain", "application/x-www-form-urlencoded", "application/jsonx"}) {
      post.headers["content-type"] = type;
      EXPECT_EQ(status(post), 415) << type;
    }
  }
}

}  // namespace
}  // namespace server
