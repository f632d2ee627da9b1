// HTTP over real loopback sockets: good manners, and every kind of bad ones.
#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

class HttpServerTest : public ApiTest {
 protected:
  std::string head(const std::string& request_line, const std::string& extra = "") const {
    return request_line + " HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer " + token() + "\r\n" + extra + "\r\n";
  }
  // Sends one request and reads until the station closes.
  std::string talk(const std::string& bytes) {
    RawClient client{clock, api->port()};
    client.send(bytes);
    return client.read_to_end();
  }
  std::string get(const std::string& target) { return talk(head("GET " + target, "Connection: close\r\n")); }
  void expect_alive() { EXPECT_TRUE(get("/api/v1/station").starts_with("HTTP/1.1 200 ")); }
};

bool says(const std::string& answer, const std::string& part) { return answer.find(part) != std::string::npos; }

TEST_F(HttpServerTest, AnswersWithSecurityHeaders) {
  const std::string answer = get("/api/v1/robots");
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 200 OK\r\n")) << answer;
  for (const char* header :
       {"Content-Security-Policy: default-src 'self'", "frame-ancestors 'none'", "X-Content-Type-Options: nosniff",
        "Referrer-Policy: no-referrer", "Content-Type: application/json", "Cache-Control: no-store"}) {
    EXPECT_TRUE(says(answer, header)) << header;
  }
  EXPECT_TRUE(answer.ends_with("{\"robots\":[]}")) << answer;
}

TEST_F(HttpServerTest, KeepsTheConnectionAndTakesPipelinedRequests) {
  RawClient client{clock, api->port()};
  client.send(head("GET /api/v1/robots") + head("GET /api/v1/robots"));
  client.read_until("{\"robots\":[]}");
  EXPECT_TRUE(client.read_until("{\"robots\":[]}").starts_with("HTTP/1.1 200"));
  client.send(head("GET /api/v1/robots"));
  EXPECT_TRUE(client.read_until("{\"robots\":[]}").starts_with("HTTP/1.1 200"));
  EXPECT_FALSE(client.closed());
}

TEST_F(HttpServerTest, HeadHasNoBody) {
  const std::string answer = talk(head("HEAD /api/v1/robots", "Connection: close\r\n"));
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 200"));
  EXPECT_TRUE(says(answer, "Content-Length: 13\r\n")) << answer;
  EXPECT_TRUE(answer.ends_with("\r\n\r\n")) << answer;
}

TEST_F(HttpServerTest, NoTokenIs401) {
  const std::string answer = talk("GET /api/v1/robots HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 401 Unauthorized")) << answer;
  EXPECT_TRUE(says(answer, "WWW-Authenticate: Bearer"));
  EXPECT_TRUE(says(answer, "application/problem+json"));
}

TEST_F(HttpServerTest, TheLoginLinkGivesACookieOnce) {
  const std::string url = api->login_url();
  const std::string target = url.substr(url.find("/login"));
  const std::string request = "GET " + target + " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
  const std::string answer = talk(request);
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 303")) << answer;
  EXPECT_TRUE(says(answer, "Location: /\r\n"));
  EXPECT_TRUE(says(answer, "; HttpOnly; SameSite=Strict; Path=/"));
  EXPECT_TRUE(talk(request).starts_with("HTTP/1.1 401"));
  const auto begin = answer.find("rheonaut_session_fedcba9876543210=");
  const std::string cookie = answer.substr(begin, answer.find(';', begin) - begin);
  const std::string with_cookie =
      talk("GET /api/v1/robots HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nCookie: " + cookie + "\r\n\r\n");
  EXPECT_TRUE(with_cookie.starts_with("HTTP/1.1 200")) << with_cookie;
}

TEST_F(HttpServerTest, WhoIsInMakesALinkForAnotherPageAndALookDoesNotUseItUp) {
  const std::string made = talk(head("POST /api/v1/login-links", "Connection: close\r\n"));
  ASSERT_TRUE(made.starts_with("HTTP/1.1 201 ")) << made;
  const json link = json::parse(made.substr(made.find("\r\n\r\n")));
  EXPECT_EQ(link["expires_at_us"], clock.utc_us() + 600'000'000);
  const std::string url = link["url"];
  ASSERT_TRUE(url.starts_with("http://localhost/login?code=")) << url;
  const std::string rest =
      " " + url.substr(url.find("/login")) + " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
  EXPECT_TRUE(talk("HEAD" + rest).starts_with("HTTP/1.1 405 "));
  EXPECT_TRUE(talk("GET" + rest).starts_with("HTTP/1.1 303 "));
  EXPECT_TRUE(talk("GET" + rest).starts_with("HTTP/1.1 401 "));
  const std::string stranger = "POST /api/v1/login-links HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
  EXPECT_TRUE(talk(stranger).starts_with("HTTP/1.1 401 "));
}

TEST_F(HttpServerTest, RefusesAWrongHost) {
  const std::string answer = talk("GET / HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n\r\n");
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 421")) << answer;
  EXPECT_TRUE(talk("GET / HTTP/1.1\r\nConnection: close\r\n\r\n").starts_with("HTTP/1.1 421"));
}

TEST_F(HttpServerTest, MalformedHttpIs400AndTheEnd) {
  for (const char* bytes :
       {"hello\r\n\r\n", "GET\r\n\r\n", "GET / HTTP/9.9\r\n\r\n", "GET / HTTP/1.1\r\nno colon\r\n\r\n",
        "\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03 this is TLS\r\n\r\n",
        "POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: x\r\n\r\n"}) {
    EXPECT_TRUE(talk(bytes).starts_with("HTTP/1.1 400 ")) << bytes;
  }
  expect_alive();
}

TEST_F(HttpServerTest, RefusesABigBodyWithoutReadingIt) {
  RawClient client{clock, api->port()};
  client.send(head("POST /api/v1/runs", "Content-Type: application/json\r\nContent-Length: 10485760\r\n"));
  EXPECT_TRUE(client.read_until("\r\n").starts_with("HTTP/1.1 413 "));
  expect_alive();
}

TEST_F(HttpServerTest, ABigBodyThatIsSentAllTheSameEnds) {
  for (const char* length : {"Content-Length: 10485760\r\n", "Transfer-Encoding: chunked\r\n"}) {
    RawClient client{clock, api->port()};
    const bool chunked = std::string_view{length}.starts_with("Transfer");
    client.send(head("POST /api/v1/runs", std::string{"Content-Type: application/json\r\n"} + length));
    client.send((chunked ? "a00000\r\n" : "") + std::string(10 * 1024 * 1024, ' '));
    EXPECT_TRUE(client.read_to_end().starts_with("HTTP/1.1 413 ")) << length;
  }
  expect_alive();
}

TEST_F(HttpServerTest, RefusesABigHeader) {
  const std::string answer = talk(head("GET /api/v1/robots", "X-Filler: " + std::string(20'000, 'x') + "\r\n"));
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 431 ")) << answer;
}

TEST_F(HttpServerTest, ASlowHeaderEndsAfterTenSeconds) {
  RawClient client{clock, api->port()};
  client.send("GET / HTTP/1.1\r\nHost: loc");
  clock.run_for(9s);
  EXPECT_FALSE(client.closed());
  clock.run_for(2s);
  EXPECT_TRUE(client.read_to_end().starts_with("HTTP/1.1 408 "));
}

TEST_F(HttpServerTest, ASlowBodyEndsAfterTenSeconds) {
  RawClient client{clock, api->port()};
  client.send(head("POST /api/v1/runs", "Content-Type: application/json\r\nContent-Length: 100\r\n") + "{");
  clock.run_for(11s);
  EXPECT_TRUE(client.read_to_end().starts_with("HTTP/1.1 408 "));
}

TEST_F(HttpServerTest, AnIdleConnectionEndsAfterAMinute) {
  RawClient client{clock, api->port()};
  client.send(head("GET /api/v1/robots"));
  client.read_until("{\"robots\":[]}");
  clock.run_for(59s);
  EXPECT_FALSE(client.closed());
  clock.run_for(3s);
  EXPECT_TRUE(client.closed());
}

TEST_F(HttpServerTest, TellsAWaitingClientToGoOn) {
  RawClient client{clock, api->port()};
  client.send(
      head("POST /api/v1/runs", "Content-Type: application/json\r\nContent-Length: 2\r\nExpect: 100-continue\r\n"));
  EXPECT_EQ(client.read_until("\r\n\r\n"), "HTTP/1.1 100 Continue\r\n\r\n");
  client.send("{}");
  EXPECT_TRUE(client.read_until("\r\n").starts_with("HTTP/1.1 400 "));
}

TEST_F(HttpServerTest, TheWrongContentTypeIs415) {
  const std::string answer =
      talk(head("POST /api/v1/runs", "Content-Type: text/plain\r\nContent-Length: 2\r\nConnection: close\r\n") + "{}");
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 415 ")) << answer;
}

TEST_F(HttpServerTest, UnknownAndHiddenPathsEndNowhere) {
  EXPECT_TRUE(get("/api/v1/nothing").starts_with("HTTP/1.1 404 "));
  EXPECT_TRUE(get("/nothing").starts_with("HTTP/1.1 404 "));
  EXPECT_TRUE(get("/../rheonaut.token").starts_with("HTTP/1.1 400 "));
  EXPECT_TRUE(get("/%2e%2e/rheonaut.token").starts_with("HTTP/1.1 400 "));
  EXPECT_TRUE(get("/assets/..%2f..%2frheonaut.token").starts_with("HTTP/1.1 400 "));
  EXPECT_TRUE(get("/rheonaut.token").starts_with("HTTP/1.1 404 "));
  EXPECT_TRUE(get("//etc/passwd").starts_with("HTTP/1.1 404 "));
}

TEST_F(HttpServerTest, ThePageComesWithoutCredential) {
  const std::string answer = talk("GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 200 ")) << answer;
  EXPECT_TRUE(says(answer, "Content-Type: text/html"));
}

TEST_F(HttpServerTest, AFileThatTheClientHasIs304) {
  const std::string first = get("/api/v1/openapi.yaml");
  const auto begin = first.find("ETag: ") + 6;
  const std::string etag = first.substr(begin, first.find("\r\n", begin) - begin);
  const std::string second =
      talk(head("GET /api/v1/openapi.yaml", "If-None-Match: " + etag + "\r\nConnection: close\r\n"));
  EXPECT_TRUE(second.starts_with("HTTP/1.1 304 ")) << second;
  EXPECT_TRUE(second.ends_with("\r\n\r\n"));
}

TEST_F(HttpServerTest, CsvIsChunkedOrEndsWithTheConnection) {
  connect_robot();
  ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "long"}});
  for (std::uint64_t seq = 0; seq < 5000; seq += 25) make_samples(*robot, seq, 25);
  const std::string chunked = get("/api/v1/runs/1/samples.csv");
  EXPECT_TRUE(says(chunked, "Transfer-Encoding: chunked\r\n"));
  EXPECT_TRUE(says(chunked, "Z,4999,0,0,0,0,0,manual,none,,0,"));
  EXPECT_TRUE(chunked.ends_with("\r\n0\r\n\r\n"));
  const std::string plain = talk(
      "GET /api/v1/runs/1/samples.csv HTTP/1.0\r\nHost: localhost\r\nAuthorization: Bearer " + token() + "\r\n\r\n");
  EXPECT_FALSE(says(plain, "Transfer-Encoding"));
  EXPECT_TRUE(says(plain.substr(plain.size() - 200), "Z,4999,0,0,0,0,0,manual,none,,0,"));
}

TEST_F(HttpServerTest, SilentConnectionsDoNotKeepAStopOut) {
  connect_robot();
  RawClient known{clock, api->port()};  // the oldest, but it has shown the token
  known.send(head("GET /api/v1/station"));
  known.read_until("}");
  std::vector<std::unique_ptr<RawClient>> silent;
  for (std::size_t i = 1; i < kMaxConnections + 40; ++i) {
    silent.push_back(std::make_unique<RawClient>(clock, api->port()));
  }
  RawClient person{clock, api->port()};
  person.send(head("POST /api/v1/robots/r1/emergency-stop"));
  ASSERT_EQ(robot->commands().size(), 1U);
  robot->acknowledge(robot->commands()[0], rheonaut_COMMAND_RESULT_ACCEPTED, 99);
  clock.settle();
  EXPECT_TRUE(person.read_until("\r\n").starts_with("HTTP/1.1 200 "));
  EXPECT_TRUE(silent.front()->closed());
  EXPECT_FALSE(silent.back()->closed());
  EXPECT_FALSE(known.closed());
}

TEST_F(HttpServerTest, TooManyConnectionsOfKnownPeopleAre503) {
  std::vector<std::unique_ptr<RawClient>> idle;
  for (std::size_t i = 0; i < kMaxConnections; ++i) {
    idle.push_back(std::make_unique<RawClient>(clock, api->port()));
    idle.back()->send(head("GET /api/v1/robots"));
    idle.back()->read_until("{\"robots\":[]}");
  }
  EXPECT_TRUE(RawClient(clock, api->port()).read_to_end().starts_with("HTTP/1.1 503 "));
  idle.pop_back();
  clock.settle();
  expect_alive();
}

TEST_F(HttpServerTest, StopsWithConnectionsOpen) {
  RawClient client{clock, api->port()};
  client.send("GET / HT");
  tasks.stop();
  clock.settle();
  EXPECT_TRUE(client.closed());
}

// Those of a station that has just been made.
struct NewCredentials {
  NewCredentials(boost::asio::io_context& loop, Clock& clock, const std::filesystem::path& folder)
      : database{folder / "station.sqlite"},
        recorder{loop, clock, disk, checkpoints, RecorderOptions{folder / "station.sqlite"}},
        accounts{loop, clock, recorder, folder},
        auth{loop, clock, accounts, folder, 1} {}
  Database database;
  WorkerThread disk{"disk"}, checkpoints{"checkpoints"};
  Recorder recorder;
  Accounts accounts;
  Auth auth;
};

// A server whose only route throws.
TEST(HttpServer, AnExceptionOfARouteIs500AndSaysNothing) {
  TemporaryFolder folder;
  boost::asio::io_context loop{1};
  VirtualClock clock{loop};
  TaskGroup tasks{loop};
  Station station{loop, clock, CommandLimits{}, LinkTimes{}};
  LiveFeed feed{clock};
  LiveParts live{loop, tasks, clock, station, feed, "0"};
  Listener listener{loop, clock, {boost::asio::ip::address_v4::loopback(), 0}};
  NewCredentials credentials{loop, clock, folder.path()};
  const RequestGuard guard{credentials.auth, {}};
  Router router;
  router.add({"GET", "/broken", Scope::anyone, {}, [](Request) -> Answer { throw std::runtime_error{"secret"}; }});
  HttpServer server{tasks, clock, listener, guard, router, live, nullptr};
  tasks.spawn("http", server.run());
  {
    RawClient client{clock, listener.endpoint().port()};
    client.send("GET /broken HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
    const std::string answer = client.read_to_end();
    EXPECT_TRUE(answer.starts_with("HTTP/1.1 500 ")) << answer;
    EXPECT_FALSE(says(answer, "secret"));
  }
  EXPECT_EQ(tasks.exit_code(), 0);
  tasks.stop();
  clock.settle();
}

// The station's clock, until it breaks.
class BrokenClock final : public Clock {
 public:
  explicit BrokenClock(Clock& clock) : clock_{clock} {}
  std::int64_t steady_us() const override { throw std::runtime_error{"the clock is broken"}; }
  std::int64_t utc_us() const override { return clock_.utc_us(); }
  boost::asio::awaitable<void> sleep_until(std::int64_t deadline_us) override {
    return clock_.sleep_until(deadline_us);
  }

 private:
  Clock& clock_;
};

TEST(HttpServer, AnExceptionOfAPageEndsThatPageOnly) {
  TemporaryFolder folder;
  boost::asio::io_context loop{1};
  VirtualClock clock{loop};
  BrokenClock broken{clock};
  TaskGroup tasks{loop};
  Station station{loop, clock, CommandLimits{}, LinkTimes{}};
  LiveFeed feed{clock};
  LiveParts live{loop, tasks, broken, station, feed, "0"};
  Listener listener{loop, clock, {boost::asio::ip::address_v4::loopback(), 0}};
  NewCredentials credentials{loop, clock, folder.path()};
  Auth& auth = credentials.auth;
  const RequestGuard guard{auth, {}};
  const Router router;
  HttpServer server{tasks, clock, listener, guard, router, live, nullptr};
  tasks.spawn("http", server.run());
  const auto session = auth.log_in(auth.new_login_code(), "", "");
  {
    RawClient client{clock, listener.endpoint().port()};
    client.send(
        "GET /live HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
        "Cookie: " +
        auth.cookie_name() + "=" + *session + "\r\n\r\n");
    client.read_to_end();
    EXPECT_TRUE(client.closed());
  }
  EXPECT_EQ(tasks.exit_code(), 0);
  EXPECT_FALSE(tasks.stopping());
  EXPECT_EQ(server.connections(), 0U);
  tasks.stop();
  clock.settle();
}

}  // namespace
}  // namespace server
