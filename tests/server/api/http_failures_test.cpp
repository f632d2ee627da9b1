// What goes wrong inside: the connection says that it did, the log says what, and the station goes on.
#include <SQLiteCpp/SQLiteCpp.h>

#include "server/api/live_socket.hpp"
#include "server/http/http_connection.hpp"
#include "server/http/http_server.hpp"
#include "server/http/request_guard.hpp"
#include "server/identity/accounts.hpp"
#include "server/identity/auth.hpp"
#include "server/live/live_feed.hpp"
#include "server/live/robot_texts.hpp"
#include "tests/server/api/live_page.hpp"
#include "tests/server/captured_log.hpp"

namespace server {
namespace {

bool says(const std::string& answer, const std::string& part) { return answer.find(part) != std::string::npos; }

class HttpFailuresTest : public ApiTest {
 protected:
  std::string send(const std::string& method, const std::string& target, const std::string& body = "") {
    RawClient client{clock, port()};
    client.send(method + " " + target + " HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer " + token() +
                "\r\nContent-Type: application/json\r\nConnection: close\r\nContent-Length: " +
                std::to_string(body.size()) + "\r\n\r\n" + body);
    return client.read_to_end();
  }
  void expect_no_internals(const std::string& answer) {
    for (const std::string& word :
         {folder.path().string(), std::string{"station.sqlite"}, std::string{"SQL"}, std::string{"no such table"},
          std::string{"SELECT"}, std::string{"exception"}, std::string{".cpp"}, std::string{"std::"}, token()}) {
      EXPECT_FALSE(says(answer, word)) << word << answer;
    }
  }
  // From another program, as nobody should.
  void spoil(const std::string& sql) {
    SQLite::Database database{recorder.path().string(), SQLite::OPEN_READWRITE};
    database.exec(sql);
  }

  CapturedLog log;
};

TEST_F(HttpFailuresTest, ADatabaseThatFailsIsReportedWithoutItsText) {
  connect_robot();
  ASSERT_EQ(ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "first"}}).status, 201);
  spoil("PRAGMA foreign_keys = OFF; ALTER TABLE run RENAME TO lost; ALTER TABLE user RENAME TO nobody");
  const std::string runs = send("GET", "/api/v1/runs");
  EXPECT_TRUE(runs.starts_with("HTTP/1.1 500 ")) << runs;
  EXPECT_TRUE(says(runs, "\"reason\":\"internal\"") && says(runs, "its log says why")) << runs;
  expect_no_internals(runs);
  EXPECT_TRUE(says(log.text(), "GET /api/v1/runs: ") && says(log.text(), "no such table")) << log.text();
  EXPECT_TRUE(says(send("GET", "/metrics"), "rheonaut_exceptions_total{where=\"request\"} 1\n"));
  const std::string user = send("POST", "/api/v1/users", R"({"name":"anna","role":"viewer","password":"long enough"})");
  EXPECT_TRUE(user.starts_with("HTTP/1.1 503 ")) << user;
  expect_no_internals(user);
}

// A sink that fails, as nothing in the station should.
class Thrower final : public station::StationSink {
 public:
  void on_command(const station::CommandRecord& record) override {
    if (record.state == station::CommandState::acknowledged) throw std::runtime_error{"no room for a command"};
  }
};

TEST_F(HttpFailuresTest, AStopThatFailsOnceItIsSentIsLoggedAndThePageGoesOn) {
  connect_robot();
  Page page{clock, port(), "Authorization: Bearer " + token() + "\r\n"};
  Thrower thrower;
  station.add_sink(thrower);
  page.say({{"type", "emergency_stop"}, {"robot_id", "r1"}});
  ASSERT_EQ(robot->commands().size(), 1U);
  robot->acknowledge(robot->commands()[0], rheonaut_COMMAND_RESULT_ACCEPTED, 7);
  clock.settle();
  EXPECT_TRUE(says(log.text(), "no room for a command")) << log.text();
  EXPECT_EQ(tasks.exceptions().count(runtime::Ended::robot_session), 1U);
  EXPECT_EQ(station.find("r1")->context.emergency_id, 7U);
  EXPECT_FALSE(page.closed());
  EXPECT_EQ(tasks.exit_code(), 0);
}

TEST_F(HttpFailuresTest, NoRefusalSpeaksOfTheInside) {
  const std::pair<const char*, const char*> wrong[] = {{"GET", "/api/v1/runs/9"},
                                                       {"GET", "/api/v1/runs/x"},
                                                       {"GET", "/api/v1/robots/nobody"},
                                                       {"GET", "/api/v1/runs?limit=x"},
                                                       {"GET", "/%2e%2e/rheonaut.token"},
                                                       {"GET", "/assets/nothing.js"},
                                                       {"PUT", "/api/v1/runs"},
                                                       {"POST", "/api/v1/runs"},
                                                       {"POST", "/api/v1/backups"},
                                                       {"GET", "/api/v1/runs/1/samples'"},
                                                       {"GET", "/api/v1/runs/9/samples.mat"}};
  for (const auto& [method, target] : wrong) {
    const std::string answer = send(method, target, method == std::string{"POST"} ? "{\"x\"" : "");
    EXPECT_TRUE(answer.starts_with("HTTP/1.1 4")) << answer;
    expect_no_internals(answer);
  }
}

// Those of a station that has just been made.
struct NewCredentials {
  NewCredentials(boost::asio::io_context& loop, runtime::Clock& clock, const std::filesystem::path& folder)
      : database{folder / "station.sqlite"},
        recorder{loop, clock, disk, checkpoints, storage::RecorderOptions{folder / "station.sqlite", {}}},
        removal_clock{clock},
        accounts{loop, clock, recorder, removal_clock, folder},
        auth{loop, clock, accounts, folder, 1} {}
  storage::Database database;
  runtime::WorkerThread disk{"disk"}, checkpoints{"checkpoints"};
  storage::Recorder recorder;
  storage::RemovalClock removal_clock;
  identity::Accounts accounts;
  identity::Auth auth;
};

// A body that fails after its first piece.
class CutStream final : public http::BodyStream {
 public:
  boost::asio::awaitable<Result<std::optional<std::string>>> next() override {
    if (has_begun_) throw std::runtime_error{"secret"};
    has_begun_ = true;
    co_return std::optional<std::string>{"first"};
  }

 private:
  bool has_begun_ = false;
};

// A server whose routes throw.
TEST(HttpServer, AnExceptionOfARouteIs500AndSaysNothing) {
  TemporaryFolder folder;
  const CapturedLog log;
  boost::asio::io_context loop{1};
  VirtualClock clock{loop};
  runtime::TaskGroup tasks{loop};
  station::Station station{loop, clock, config::Envelope{}, config::LinkTimes{}};
  live::LiveFeed feed{clock};
  live::RobotTexts texts{loop, station};
  api::LiveParts live{loop, tasks, clock, station, feed, texts, "0"};
  const auto serve = [&](http::HttpStream stream, http::UpgradeRequest upgrade, identity::Caller caller) {
    return serve_live(std::move(stream), std::move(upgrade), std::move(caller), live);
  };
  http::Upgrades upgrades{{{"/live", {serve}}}};
  net::Listener listener{loop, clock, {boost::asio::ip::address_v4::loopback(), 0}};
  NewCredentials credentials{loop, clock, folder.path()};
  const http::RequestGuard guard{credentials.auth, {}};
  http::Router router;
  router.add({"GET", "/broken", identity::Scope::anyone, {"code"}, [](http::Request) -> http::Answer {
                throw std::runtime_error{"secret"};
              }});
  router.add({"GET", "/cut", identity::Scope::anyone, {}, [](http::Request) -> http::Answer {
                http::Response response;
                response.stream = std::make_unique<CutStream>();
                co_return response;
              }});
  net::PortAccess access{{clock, "http port", net::ConnectionLimits{}}, nullptr};
  http::HttpServer server{tasks, clock, listener, access, guard, router, upgrades};
  tasks.spawn("http", server.run());
  {
    RawClient client{clock, listener.endpoint().port()};
    client.send("GET /broken?code=4711 HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
    const std::string answer = client.read_to_end();
    EXPECT_TRUE(answer.starts_with("HTTP/1.1 500 ")) << answer;
    EXPECT_FALSE(log.has("4711")) << "a one-time code is never logged";
    EXPECT_FALSE(says(answer, "secret"));
  }
  EXPECT_TRUE(log.has("GET /broken: secret")) << log.text();
  EXPECT_EQ(tasks.exceptions().count(runtime::Ended::request), 1U);
  {
    RawClient client{clock, listener.endpoint().port()};
    client.send("GET /cut HTTP/1.1\r\nHost: localhost\r\n\r\n");
    const std::string answer = client.read_to_end();
    EXPECT_TRUE(says(answer, "first") && !answer.ends_with("0\r\n\r\n")) << answer;
  }
  clock.run_for(1s);
  EXPECT_EQ(tasks.exceptions().count(runtime::Ended::request), 2U);
  EXPECT_EQ(tasks.exit_code(), 0);
  tasks.stop();
  clock.settle();
}

// The station's clock, until it breaks.
class BrokenClock final : public runtime::Clock {
 public:
  explicit BrokenClock(runtime::Clock& clock) : clock_{clock} {}
  std::int64_t steady_us() const override { throw std::runtime_error{"the clock is broken"}; }
  std::int64_t utc_us() const override { return clock_.utc_us(); }
  using runtime::Clock::sleep_until;
  boost::asio::awaitable<void> sleep_until(std::int64_t deadline_us, Alarm* alarm) override {
    return clock_.sleep_until(deadline_us, alarm);
  }

 private:
  runtime::Clock& clock_;
};

TEST(HttpServer, AnExceptionOfAPageEndsThatPageOnly) {
  TemporaryFolder folder;
  boost::asio::io_context loop{1};
  VirtualClock clock{loop};
  BrokenClock broken{clock};
  runtime::TaskGroup tasks{loop};
  station::Station station{loop, clock, config::Envelope{}, config::LinkTimes{}};
  live::LiveFeed feed{clock};
  live::RobotTexts texts{loop, station};
  api::LiveParts live{loop, tasks, broken, station, feed, texts, "0"};
  const auto serve = [&](http::HttpStream stream, http::UpgradeRequest upgrade, identity::Caller caller) {
    return serve_live(std::move(stream), std::move(upgrade), std::move(caller), live);
  };
  http::Upgrades upgrades{{{"/live", {serve}}}};
  net::Listener listener{loop, clock, {boost::asio::ip::address_v4::loopback(), 0}};
  NewCredentials credentials{loop, clock, folder.path()};
  identity::Auth& auth = credentials.auth;
  const http::RequestGuard guard{auth, {}};
  const http::Router router;
  net::PortAccess access{{clock, "http port", net::ConnectionLimits{}}, nullptr};
  http::HttpServer server{tasks, clock, listener, access, guard, router, upgrades};
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
  EXPECT_EQ(access.limiter.connections(), 0U);
  EXPECT_EQ(tasks.exceptions().count(runtime::Ended::live_page), 1U);
  tasks.stop();
  clock.settle();
}

}  // namespace
}  // namespace server
