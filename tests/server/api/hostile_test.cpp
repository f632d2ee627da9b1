// Slow and hostile clients of the HTTP port: what becomes of them, and that a robot is stopped all the while.
#include "server/http/http_connection.hpp"
#include "server/live/live_feed.hpp"
#include "server/net/transport_security.hpp"
#include "tests/server/api/live_page.hpp"

namespace server {
namespace {

config::Config small_station() {
  config::Config config;
  config.http_places = {16, 4};  // from an address of this machine 12
  return config;
}

class HostileTest : public ApiTest {
 protected:
  explicit HostileTest(config::Config of_station = {}) : ApiTest{std::move(of_station)} {
    connect_robot();
    operator_ = std::make_unique<RawClient>(clock, port());
    expect_stops(*operator_);  // signed in before the trouble begins
  }

  std::string head(const std::string& request_line, const std::string& extra = "") const {
    return request_line + " HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer " + token() + "\r\n" + extra + "\r\n";
  }
  std::string post(const std::string& target, const std::string& body) const {
    return head("POST " + target,
                "Content-Type: application/json\r\nContent-Length: " + std::to_string(body.size()) + "\r\n") +
           body;
  }
  std::unique_ptr<RawClient> dial(const char* from = "127.0.0.1") {
    return std::make_unique<RawClient>(clock, port(), from);
  }

  // The stop reaches the robot in the turn in which it arrives, and its answer the operator.
  void expect_stops(RawClient& client) {
    const std::size_t before = robot->commands().size();
    client.send(head("POST /api/v1/robots/r1/emergency-stop"));
    ASSERT_EQ(robot->commands().size(), before + 1);
    robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_ACCEPTED, ++stops_);
    clock.settle();
    const std::string answer = client.read_until("\r\n\r\n");
    EXPECT_TRUE(answer.starts_with("HTTP/1.1 200 ")) << answer;
    const auto length = answer.find("Content-Length: ") + 16;
    client.read_exactly(std::stoul(answer.substr(length)));
  }
  void expect_stops() {
    expect_stops(*operator_);  // on the connection that was open before
    auto another = dial("127.0.0.9");
    expect_stops(*another);
  }

  std::unique_ptr<RawClient> operator_;

 private:
  std::uint64_t stops_ = 0;
};

class SmallHostileTest : public HostileTest {
 protected:
  SmallHostileTest() : HostileTest{small_station()} {}
};

TEST_F(HostileTest, SlowlorisIsEndedAfterTenSecondsHoweverItDrips) {
  std::vector<std::unique_ptr<RawClient>> drips;
  for (int i = 0; i < 60; ++i) {
    drips.push_back(dial());
    drips.back()->send(i % 2 == 0
                           ? "GET / HTTP/1.1\r\nHost: localhost\r\nX-Filler: "
                           : head("POST /api/v1/runs", "Content-Type: application/json\r\nContent-Length: 1000\r\n"));
  }
  for (int second = 0; second < 11; ++second) {
    for (const auto& drip : drips) drip->send("x");
    expect_stops();
    clock.run_for(1s);
  }
  for (const auto& drip : drips) EXPECT_TRUE(drip->read_to_end().starts_with("HTTP/1.1 408 "));
  expect_stops();
}

TEST_F(HostileTest, AThousandIdleConnectionsLeaveRoom) {
  std::vector<std::unique_ptr<RawClient>> idle;
  for (int i = 0; i < 1000; ++i) {
    idle.push_back(dial(i % 2 == 0 ? "127.0.0.1" : "127.0.0.2"));
    if (i % 100 == 99) expect_stops();
  }
  const net::ConnectionLimiter& limiter = security.http().limiter;
  EXPECT_LE(limiter.connections(), limiter.limits().connections);
  EXPECT_GE(limiter.counters().replaced, 700U);
  EXPECT_EQ(limiter.counters().refused, 0U);
  clock.run_for(11s);
  EXPECT_LE(limiter.connections(), 3U) << "they never said a word";
  expect_stops();
}

TEST_F(HostileTest, AStopGoesThroughTenThousandBadLogins) {
  EXPECT_EQ(
      ask("POST", "/api/v1/users", {{"name", "anna"}, {"role", "operator"}, {"password", "correct horse"}}).status,
      201);
  auto guesser = dial("127.0.0.2");
  const json guess{{"user", "anna"}, {"password", "guess"}};
  const std::string request = post("/api/v1/login", guess.dump());
  int refused = 0;
  for (int i = 0; i < 10'000; ++i) {
    guesser->send(request);
    const std::string answer = guesser->read_until("}");
    refused += answer.starts_with("HTTP/1.1 401 ") || answer.starts_with("HTTP/1.1 429 ") ? 1 : 0;
    if (i % 1000 == 999) expect_stops();
  }
  EXPECT_EQ(refused, 10'000);
}

TEST_F(HostileTest, OversizedAndDeeplyNestedJsonIsRefused) {
  const std::string command = "/api/v1/robots/r1/commands";
  const std::string deep = R"({"kind":)" + std::string(30'000, '[') + std::string(30'000, ']') + "}";
  const std::string wide = R"({"kind":"ping","x":")" + std::string(70'000, 'x') + "\"}";
  for (const char* target : {"/api/v1/robots/r1/commands", "/api/v1/runs", "/api/v1/robots/r1/markers",
                             "/api/v1/tokens", "/api/v1/users", "/api/v1/robots/r1/control"}) {
    auto client = dial();
    client->send(post(target, deep));
    const std::string answer = client->read_until("\r\n");
    EXPECT_TRUE(answer.starts_with("HTTP/1.1 40")) << target << answer;
    expect_stops();
  }
  auto client = dial();
  client->send(post(command, wide));
  EXPECT_TRUE(client->read_until("\r\n").starts_with("HTTP/1.1 413 "));
  Page page{clock, port(), "Authorization: Bearer " + token() + "\r\n"};
  page.say_text(R"({"type":)" + std::string(2000, '['));
  EXPECT_EQ(page.receive("problem").at("problem").at("reason"), "malformed_json");
  page.say_text(R"({"type":")" + std::string(5000, 'x') + "\"}");
  page.receive("nothing");
  EXPECT_TRUE(page.closed());
  expect_stops();
}

TEST_F(HostileTest, WhatFollowsARefusedHeadIsReadTooButNotWithoutEnd) {
  for (const char* refused :
       {"hello\r\n", "GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\nContent-Length: 9999999\r\n\r\n", "GET / HTTP/1.1\r\n"}) {
    RawClient client{clock, port()};
    std::string fields;
    while (fields.size() < 10 * 1024 * 1024) fields += "X: 1\r\n";
    EXPECT_TRUE(client.send(refused + fields)) << refused;
    EXPECT_TRUE(client.read_until("\r\n").starts_with("HTTP/1.1 4")) << refused;
  }
  RawClient endless{clock, port()};
  endless.send("hello\r\n");
  EXPECT_FALSE(endless.send(std::string(80 * 1024 * 1024, ' ')));
  expect_stops();
}

// The client stays alive and reads nothing: its messages wait within bounds, and then its connection ends.
TEST_F(HostileTest, APageThatNeverReadsIsLetGo) {
  Page page{clock, port(), "Authorization: Bearer " + token() + "\r\n"};
  ASSERT_TRUE(page.open());
  station::SampleBatch batch;
  batch.robot_id = "r1";
  batch.boot_id = 77;
  batch.samples.resize(25);
  page.client().reads = false;
  for (int i = 0; i < 40; ++i) {  // more than the sockets' buffers take
    for (int j = 0; j < 300; ++j) live.on_samples(*station.find("r1"), batch);
    clock.settle();
  }
  const auto keep_alive = [&](int seconds) {
    for (int second = 0; second < seconds; ++second) {
      page.say({{"type", "keep_alive"}});
      expect_stops();
      clock.run_for(1s);
    }
  };
  keep_alive(28);
  EXPECT_EQ(security.http().limiter.connections(), 2U);
  keep_alive(5);
  EXPECT_EQ(security.http().limiter.connections(), 1U) << "let go";
}

// A flood of messages is the flooder's own wait; a stop is obeyed all the same.
TEST_F(HostileTest, ATalkativePageIsReadABoundedNumberOfTimesASecond) {
  Page page{clock, port(), "Authorization: Bearer " + token() + "\r\n"};
  const std::size_t before = robot->commands().size();
  std::size_t stops_read = 0;
  for (int i = 0; i < 600; ++i) {
    page.say({{"type", "emergency_stop"}, {"robot_id", "r1"}});
    if (robot->commands().size() == before + stops_read) continue;
    robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_ACCEPTED, ++stops_read);
    clock.settle();
  }
  EXPECT_EQ(stops_read, 500U);
  expect_stops();
  clock.run_for(1s);
  EXPECT_GT(robot->commands().size(), before + stops_read + 2);
}

TEST_F(HostileTest, OneUserHasABoundedNumberOfPages) {
  const std::string bearer = "Authorization: Bearer " + token() + "\r\n";
  std::vector<std::unique_ptr<Page>> pages;
  for (std::size_t i = 0; i < http::kMaxPagesOfOne; ++i) {
    pages.push_back(std::make_unique<Page>(clock, port(), bearer));
    ASSERT_TRUE(pages.back()->open()) << i;
  }
  EXPECT_TRUE(Page(clock, port(), bearer).answer.starts_with("HTTP/1.1 429 "));
  const json other = ask("POST", "/api/v1/tokens", {{"name", "other"}, {"scopes", "read,stop"}}).parsed();
  const std::string others = "Authorization: Bearer " + other.at("secret").get<std::string>() + "\r\n";
  EXPECT_TRUE(Page(clock, port(), others).open()) << "somebody else's";
  expect_stops();
  pages.pop_back();
  clock.settle();
  EXPECT_TRUE(Page(clock, port(), bearer).open());
}

TEST_F(SmallHostileTest, IdleConnectionsOfKnownPeopleGiveWayAndBusyOnesStay) {
  const std::string bearer = "Authorization: Bearer " + token() + "\r\n";
  std::vector<std::unique_ptr<RawClient>> idle;
  for (int i = 0; i < 20; ++i) {
    idle.push_back(dial());
    idle.back()->send(head("GET /api/v1/robots"));
    EXPECT_TRUE(idle.back()->read_until("\r\n").starts_with("HTTP/1.1 200 ")) << i;
  }
  idle.clear();
  clock.settle();
  std::vector<std::unique_ptr<Page>> pages;
  for (int i = 0; i < 12; ++i) {
    pages.push_back(std::make_unique<Page>(clock, port(), bearer));
    EXPECT_TRUE(pages.back()->open()) << i;
  }
  const auto over = dial();
  over->send(head("GET /api/v1/robots"));
  EXPECT_TRUE(over->read_to_end().starts_with("HTTP/1.1 503 ")) << "all of its places are in use";
  expect_stops(*dial());
  auto another = dial("127.0.0.9");
  expect_stops(*another);
  for (int i = 0; i < 3; ++i) {
    pages.push_back(std::make_unique<Page>(clock, port(), bearer, "127.0.0.8"));
    EXPECT_TRUE(pages.back()->open()) << i;
  }
  expect_stops(*another);
  pages.push_back(std::make_unique<Page>(clock, port(), bearer, "127.0.0.8"));
  EXPECT_TRUE(another->closed()) << "idle between two requests";
  const auto beyond = dial("127.0.0.7");
  beyond->send(head("GET /api/v1/robots"));
  EXPECT_TRUE(beyond->read_to_end().starts_with("HTTP/1.1 503 "));
  expect_stops(*dial("127.0.0.7"));
  const auto health = dial("127.0.0.7");
  health->send("GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n");
  EXPECT_TRUE(health->read_until("\r\n").starts_with("HTTP/1.1 200 "));
  const std::size_t before = robot->commands().size();
  pages.front()->say({{"type", "emergency_stop"}, {"robot_id", "r1"}});
  EXPECT_EQ(robot->commands().size(), before + 1) << "a page that is open stops though all places are taken";
}

// Else it would hold one of the descriptors of those who leave until its time is over.
TEST_F(SmallHostileTest, AQuestionThatGivesItsPlaceUpIsWorkedAtNoFurther) {
  ASSERT_EQ(ask("POST", "/api/v1/experiments", {{"robot_id", "r1"}, {"profile", "figure_7"}}).status, 202);
  std::vector<std::unique_ptr<RawClient>> polls;
  for (int i = 0; i < 40; ++i) {
    polls.push_back(dial("127.0.0.8"));
    polls.back()->send(head("GET /api/v1/experiments/1?wait_ms=20000"));
  }
  clock.settle();
  EXPECT_LE(security.http().limiter.connections(), 16U);
  EXPECT_TRUE(polls.front()->read_until("\r\n").starts_with("HTTP/1.1 503 "));
  expect_stops();
}

}  // namespace
}  // namespace server
