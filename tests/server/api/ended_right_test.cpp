// What of a request that goes on ends when its right ends: questions that wait, long answers, jobs, and what the
// station does in that name (tests/system/ended_rights_test.cpp has the robot).
#include "server/http/http_server.hpp"
#include "server/http/router.hpp"
#include "server/identity/auth.hpp"
#include "server/net/listener.hpp"
#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

class EndedRightTest : public ApiTest {
 protected:
  std::string make_token(const std::string& name) {
    const Answered made = ask("POST", "/api/v1/tokens", {{"name", name}, {"scopes", "command,record"}});
    return made.parsed()["secret"];
  }
  void revoke(const std::string& name) { ASSERT_EQ(ask("POST", "/api/v1/tokens/" + name + "/revoke").status, 200); }
  static std::string get(const std::string& target, const std::string& secret) {
    return "GET " + target + " HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer " + secret + "\r\n\r\n";
  }
  // Until it is cancelled.
  storage::JobId begin_job(const std::string& owner) {
    const storage::JobWork work = [this](storage::JobRun& run) -> boost::asio::awaitable<Result<std::string>> {
      while (!run.is_cancelled()) co_await clock.sleep_for(100ms);
      co_return std::string{"{}"};
    };
    storage::JobRequest request;
    request.kind = "report";
    request.owner = owner;
    storage::JobId id = 0;
    tasks.spawn("job", keep_id(recording.jobs.begin(std::move(request), work), id));
    EXPECT_TRUE(clock.run_until([&] { return id != 0; }, 1s));
    return id;
  }
  std::string state_of(storage::JobId id) { return ask("GET", "/api/v1/jobs/" + std::to_string(id)).parsed()["state"]; }

 private:
  static boost::asio::awaitable<void> keep_id(boost::asio::awaitable<Result<storage::Job>> begun, storage::JobId& id) {
    id = (co_await std::move(begun)).value().id;
  }
};

TEST_F(EndedRightTest, AQuestionThatWaitsIsAnsweredAtOnce) {
  const std::string secret = make_token("poller");
  const storage::JobId job = begin_job("token:local");
  RawClient client{clock, port()};
  client.send(get("/api/v1/jobs/" + std::to_string(job) + "?wait_ms=20000", secret));
  const std::int64_t before_us = clock.steady_us();
  revoke("poller");
  const std::string answer = client.read_until("}");
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 403 ")) << answer;
  EXPECT_NE(answer.find("the credential of token:poller was revoked"), std::string::npos) << answer;
  EXPECT_LT(clock.steady_us() - before_us, 1'000'000);
  client.send(get("/api/v1/jobs", secret));
  EXPECT_TRUE(client.read_until("\r\n").starts_with("HTTP/1.1 401 "));
}

TEST_F(EndedRightTest, JobsAreCancelledThatWaitOrRunAndNoOthers) {
  make_token("lab");
  const storage::JobId running = begin_job("token:lab"), waiting = begin_job("token:lab");
  const storage::JobId of_another = begin_job("token:local");
  revoke("lab");
  clock.run_for(1s);
  EXPECT_EQ(state_of(running), "cancelled");
  EXPECT_EQ(state_of(waiting), "cancelled");
  EXPECT_EQ(state_of(of_another), "running");
}

TEST_F(EndedRightTest, AJobThatIsBeingStoredBeginsNot) {
  make_token("lab");
  std::optional<Result<storage::Job>> begun;
  const auto keep = [](boost::asio::awaitable<Result<storage::Job>> job,
                       std::optional<Result<storage::Job>>& into) -> boost::asio::awaitable<void> {
    into = co_await std::move(job);
  };
  storage::JobRequest request;
  request.kind = "report";
  request.owner = "token:lab";
  bool has_worked = false;
  const storage::JobWork work = [&](storage::JobRun&) -> boost::asio::awaitable<Result<std::string>> {
    has_worked = true;
    co_return std::string{"{}"};
  };
  tasks.spawn("job", keep(recording.jobs.begin(std::move(request), work), begun));
  loop.poll_one();  // it is on its way to the disk
  ASSERT_FALSE(begun);
  runtime::EndedRight right{[](const std::string& each) { return each == "token:lab"; }, "a test"};
  recording.jobs.end_right(right);
  ASSERT_TRUE(clock.run_until([&] { return begun.has_value(); }, 1s));
  ASSERT_FALSE(*begun);
  EXPECT_EQ(begun->error().code, ErrorCode::forbidden);
  clock.run_for(1s);
  EXPECT_FALSE(has_worked);
  EXPECT_EQ(state_of(1), "cancelled");
}

TEST_F(EndedRightTest, ControlEndsAndSaysWhy) {
  connect_robot();
  make_token("driver");
  ASSERT_TRUE(station.control({"r1", "token:driver", "", station::ControlAction::take, 60s, ""}));
  revoke("driver");
  EXPECT_EQ(station.holder("r1"), "");
  const json events = ask("GET", "/api/v1/robots/r1/events").parsed()["events"];
  const auto ended =
      std::ranges::find(events, "control_ended_with_right", [](const json& event) { return event["kind"]; });
  ASSERT_NE(ended, events.end()) << events;
  EXPECT_EQ((*ended)["detail"], "of token:driver: token 'driver' was revoked by token:local");
}

// A body that is never done.
class LongStream final : public http::BodyStream {
 public:
  explicit LongStream(runtime::Clock& clock) : clock_{clock} {}
  boost::asio::awaitable<Result<std::optional<std::string>>> next() override {
    co_await clock_.sleep_for(100ms);
    co_return std::optional<std::string>{"more "};
  }

 private:
  runtime::Clock& clock_;
};

TEST(HttpServer, ALongAnswerEndsWithTheRightOfWhoAskedForIt) {
  TemporaryFolder folder;
  boost::asio::io_context loop{1};
  VirtualClock clock{loop};
  runtime::TaskGroup tasks{loop};
  http::Upgrades upgrades{{}};
  net::Listener listener{loop, clock, {boost::asio::ip::address_v4::loopback(), 0}};
  storage::Database database{folder.path() / "station.sqlite"};
  runtime::WorkerThread disk{"disk"}, checkpoints{"checkpoints"};
  storage::Recorder recorder{loop, clock, disk, checkpoints,
                             storage::RecorderOptions{folder.path() / "station.sqlite", {}}};
  const storage::RemovalClock removal_clock{clock};
  identity::Accounts accounts{loop, clock, recorder, removal_clock, folder.path()};
  identity::Auth auth{loop, clock, accounts, folder.path(), 1};
  const http::RequestGuard guard{auth, {}};
  http::Router router;
  router.add({"GET", "/api/v1/long", identity::Scope::read, {}, [&clock](http::Request) -> http::Answer {
                http::Response response;
                response.stream = std::make_unique<LongStream>(clock);
                co_return response;
              }});
  net::PortAccess access{{clock, "http port", net::ConnectionLimits{}}, nullptr};
  http::HttpServer server{tasks, clock, listener, access, guard, router, upgrades};
  tasks.spawn("http", server.run());
  const std::string secret = accounts.open_session("", "127.0.0.1", "");
  RawClient client{clock, listener.endpoint().port()};
  client.send("GET /api/v1/long HTTP/1.1\r\nHost: localhost\r\nCookie: " + auth.cookie_name() + "=" + secret +
              "\r\n\r\n");
  clock.run_for(500ms);
  const std::string begun = client.read_until("more ");
  EXPECT_TRUE(begun.starts_with("HTTP/1.1 200 ")) << begun;
  EXPECT_FALSE(client.closed());
  accounts.sessions().back().standing->end();
  clock.run_for(1s);
  const std::string rest = client.read_to_end();
  EXPECT_TRUE(client.closed());
  EXPECT_FALSE(rest.ends_with("0\r\n\r\n")) << "who reads it sees that it is not whole";
  tasks.stop();
  clock.settle();
}

}  // namespace
}  // namespace server
