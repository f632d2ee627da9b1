// Token, login codes, sessions, and who is let in.
#include <sys/stat.h>

#include <fstream>

#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

class AuthTest : public ::testing::Test {
 protected:
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

  TemporaryFolder folder;
  std::filesystem::path file = folder.path() / "rheonaut.token";
  boost::asio::io_context loop;
  VirtualClock clock{loop};
};

TEST_F(AuthTest, MakesATokenThatOnlyItsOwnerReads) {
  const Auth auth{clock, folder.path()};
  EXPECT_EQ(token().size(), 43U);  // 256 bits
  EXPECT_EQ(mode(), 0600U);
  EXPECT_EQ(auth.actor_of_token(token()), "token:local");
  EXPECT_FALSE(auth.actor_of_token(""));
  EXPECT_FALSE(auth.actor_of_token(token() + "x"));
  EXPECT_FALSE(std::filesystem::exists(file.string() + ".new"));
}

TEST_F(AuthTest, KeepsAValidTokenAndProtectsIt) {
  {
    const Auth first{clock, folder.path()};
  }
  const std::string before = token();
  chmod(file.c_str(), 0644);
  const Auth second{clock, folder.path()};
  EXPECT_EQ(token(), before);
  EXPECT_EQ(mode(), 0600U);
}

TEST_F(AuthTest, ReplacesWhatIsNoToken) {
  for (const char* text : {"", "short", "////////////////////////////////////////////////"}) {
    write(text);
    const Auth auth{clock, folder.path()};
    EXPECT_EQ(token().size(), 43U) << text;
    EXPECT_TRUE(auth.actor_of_token(token()));
    EXPECT_EQ(mode(), 0600U);
  }
}

TEST_F(AuthTest, SaysWhichFileItCannotWrite) {
  try {
    const Auth auth{clock, folder.path() / "missing"};
    FAIL();
  } catch (const std::exception& error) {
    EXPECT_NE(std::string{error.what()}.find("rheonaut.token"), std::string::npos) << error.what();
  }
}

TEST_F(AuthTest, ACodeOpensOneSessionOnce) {
  Auth auth{clock, folder.path()};
  const std::string code = auth.new_login_code();
  EXPECT_FALSE(auth.log_in("guess"));
  const auto session = auth.log_in(code);
  ASSERT_TRUE(session);
  EXPECT_FALSE(auth.log_in(code));
  EXPECT_EQ(auth.actor_of_session(*session), "session:1");
  EXPECT_FALSE(auth.actor_of_session(code));
  EXPECT_FALSE(auth.actor_of_token(*session));
}

TEST_F(AuthTest, ASessionOutlivesTheStation) {
  std::string session;
  {
    Auth auth{clock, folder.path()};
    session = *auth.log_in(auth.new_login_code());
  }
  struct stat status{};
  stat((folder.path() / "rheonaut.sessions").c_str(), &status);
  EXPECT_EQ(status.st_mode & 0777U, 0600U);
  {
    Auth auth{clock, folder.path()};
    EXPECT_EQ(auth.actor_of_session(session), "session:1");
    EXPECT_EQ(auth.actor_of_session(*auth.log_in(auth.new_login_code())), "session:2");
  }
  clock.run_for(12h);
  Auth late{clock, folder.path()};
  EXPECT_FALSE(late.actor_of_session(session));
}

TEST_F(AuthTest, ADamagedSessionFileLetsNobodyIn) {
  std::ofstream{folder.path() / "rheonaut.sessions"} << "1 99999999999999999 zz\n2 99999999999999999\n";
  Auth auth{clock, folder.path()};
  EXPECT_FALSE(auth.actor_of_session(""));
}

TEST_F(AuthTest, CodesAndSessionsEndInTime) {
  Auth auth{clock, folder.path()};
  const std::string late = auth.new_login_code();
  clock.run_for(10min);
  EXPECT_FALSE(auth.log_in(late));
  const auto session = auth.log_in(auth.new_login_code());
  ASSERT_TRUE(session);
  clock.run_for(12h);
  EXPECT_FALSE(auth.actor_of_session(*session));
}

TEST_F(AuthTest, ASessionInUseIsRenewed) {
  const auto saved = [this] {
    std::ifstream in{folder.path() / "rheonaut.sessions"};
    return std::string{std::istreambuf_iterator<char>{in}, {}};
  };
  std::string session;
  {
    Auth auth{clock, folder.path()};
    session = *auth.log_in(auth.new_login_code());
    const std::string first = saved();
    clock.run_for(59min);
    EXPECT_TRUE(auth.actor_of_session(session));
    EXPECT_EQ(saved(), first) << "saved at most once an hour";
    clock.run_for(12h - 1s);
    EXPECT_TRUE(auth.actor_of_session(session));
    EXPECT_NE(saved(), first);
  }
  clock.run_for(12h - 1s);
  Auth restarted{clock, folder.path()};
  EXPECT_TRUE(restarted.actor_of_session(session));
  clock.run_for(12h);
  EXPECT_FALSE(restarted.actor_of_session(session));
}

TEST_F(AuthTest, ASessionThatCannotBeSavedIsRenewedAllTheSame) {
  Auth auth{clock, folder.path()};
  const auto session = auth.log_in(auth.new_login_code());
  std::filesystem::remove_all(folder.path());
  for (int i = 0; i < 4; ++i) {
    clock.run_for(6h);
    EXPECT_TRUE(auth.actor_of_session(*session));
  }
}

TEST_F(AuthTest, ForgetsTheOldestWhenThereAreTooMany) {
  Auth auth{clock, folder.path()};
  const std::string first_code = auth.new_login_code();
  for (std::size_t i = 0; i < kMaxLoginCodes; ++i) auth.new_login_code();
  EXPECT_FALSE(auth.log_in(first_code));
  const auto first = auth.log_in(auth.new_login_code());
  for (std::size_t i = 0; i < kMaxSessions; ++i) auth.log_in(auth.new_login_code());
  EXPECT_FALSE(auth.actor_of_session(*first));
}

class RequestGuardTest : public AuthTest {
 protected:
  RequestGuardTest() { session = *auth.log_in(auth.new_login_code()); }

  Request request(const std::string& method, const std::string& target) const {
    Request made;
    made.method = method;
    made.target = target;
    made.headers["host"] = "localhost:8080";
    return made;
  }
  Request with_token(const std::string& method, const std::string& target) const {
    Request made = request(method, target);
    made.headers["authorization"] = "Bearer " + token();
    return made;
  }
  Request with_cookie(const std::string& method, const std::string& target) const {
    Request made = request(method, target);
    made.headers["cookie"] = "theme=dark; rheonaut_session=" + session;
    return made;
  }
  int status(const Request& asked) const {
    const auto admitted = guard.admit(asked);
    return admitted ? 200 : admitted.error().status;
  }

  Auth auth{clock, folder.path()};
  RequestGuard guard{auth, {"Station.Lab", "192.168.1.5"}};
  std::string session;
};

TEST_F(RequestGuardTest, NamesWhoAsks) {
  EXPECT_EQ(guard.admit(with_token("GET", "/api/v1/robots")).value(), "token:local");
  EXPECT_EQ(guard.admit(with_cookie("GET", "/api/v1/robots")).value(), "session:1");
  EXPECT_EQ(guard.admit(request("GET", "/")).value(), "");
}

TEST_F(RequestGuardTest, EverythingWithDataNeedsACredential) {
  for (const char* target : {"/api/v1/robots", "/api/v1/nothing", "/api/v1/openapi.yaml", "/live", "/%61pi/v1/robots",
                             "/%6cive", "/api/v1/robots?x=/login"}) {
    EXPECT_EQ(status(request("GET", target)), 401) << target;
  }
  EXPECT_EQ(status(request("POST", "/api/v1/emergency-stop")), 401);
  EXPECT_EQ(status(request("POST", "/")), 401);
  for (const char* target : {"/", "/login?code=x", "/assets/main.js"}) {
    EXPECT_EQ(status(request("GET", target)), 200) << target;
  }
  Request wrong = with_cookie("GET", "/api/v1/robots");
  for (const char* credential : {"Bearer wrong", "Bearer ", "Basic abc", "Bearer"}) {
    wrong.headers["authorization"] = credential;
    EXPECT_EQ(status(wrong), 401) << credential;
  }
}

TEST_F(RequestGuardTest, AnswersOnlyToItsOwnNames) {
  Request asked = with_token("GET", "/api/v1/robots");
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

TEST_F(RequestGuardTest, RefusesOtherOriginsForChangesAndForLive) {
  for (const char* origin : {"http://evil.example", "null", "http://localhost:8081", "https://localhost:8080"}) {
    Request post = with_token("POST", "/api/v1/emergency-stop");
    post.headers["origin"] = origin;
    EXPECT_EQ(status(post), 403) << origin;
    Request live = with_cookie("GET", "/live");
    live.headers["origin"] = origin;
    EXPECT_EQ(status(live), 403) << origin;
  }
  Request own = with_cookie("GET", "/live");
  own.headers["origin"] = "http://localhost:8080";
  EXPECT_EQ(status(own), 200);
  EXPECT_EQ(status(with_cookie("GET", "/live")), 200);
}

TEST_F(RequestGuardTest, AChangeByCookieMustSayThatItComesFromTheStationsPage) {
  EXPECT_EQ(status(with_cookie("POST", "/api/v1/emergency-stop")), 403);
  Request post = with_cookie("POST", "/api/v1/emergency-stop");
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
  Request post = with_token("POST", "/api/v1/runs");
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

}  // namespace
}  // namespace server
