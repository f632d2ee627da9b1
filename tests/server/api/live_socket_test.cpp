// /live over a real socket, with WebSocket frames made by hand.
#include "server/live/live_feed.hpp"
#include "tests/server/api/live_page.hpp"

namespace server {
namespace {

class LiveSocketTest : public ApiTest {
 protected:
  std::string bearer() const { return "Authorization: Bearer " + token() + "\r\n"; }
  std::unique_ptr<Page> open_page(const std::string& target = "/live") {
    const auto nothing = [] {};
    auto page = std::make_unique<Page>(clock, port(), bearer(), "127.0.0.1", nothing, target);
    EXPECT_TRUE(page->open()) << page->answer;
    return page;
  }
  std::vector<protocol::Command> commands(pb_size_t action) const {
    auto all = robot->commands();
    std::erase_if(all, [action](const protocol::Command& command) { return command.which_action != action; });
    return all;
  }
};

TEST_F(LiveSocketTest, WelcomesWithEveryRobotThenSendsWhatHappens) {
  connect_robot();
  const auto page = open_page();
  const json welcome = page->receive("welcome");
  EXPECT_EQ(welcome["robots"][0]["robot_id"], "r1");
  EXPECT_EQ(welcome["version"], "0.1.0");
  make_samples(*robot, 0, 5);
  EXPECT_EQ(page->receive("samples")["position_m"], (json{0, 1, 2, 3, 4}));
  clock.run_for(200ms);
  EXPECT_LE(page->receive("stamp")["stamp_us"], clock.steady_us());
}

TEST_F(LiveSocketTest, NeedsACredentialAndItsOwnOrigin) {
  EXPECT_TRUE(Page(clock, port(), "").answer.starts_with("HTTP/1.1 401"));
  EXPECT_TRUE(Page(clock, port(), bearer() + "Origin: http://evil.example\r\n").answer.starts_with("HTTP/1.1 403"));
  EXPECT_TRUE(Page(clock, port(), bearer() + "Origin: http://localhost\r\n").open());
}

TEST_F(LiveSocketTest, SpeaksWebSocketOnly) {
  RawClient client{clock, port()};
  client.send("GET /live HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n" + bearer() + "\r\n");
  EXPECT_TRUE(client.read_to_end().starts_with("HTTP/1.1 426"));
}

TEST_F(LiveSocketTest, StopsOneRobotOrAll) {
  connect_robot();
  const auto page = open_page();
  page->say({{"type", "emergency_stop"}, {"robot_id", "r1"}});
  ASSERT_EQ(commands(rheonaut_Command_emergency_stop_tag).size(), 1U);
  const json received = page->receive("command");
  EXPECT_EQ(received["command"]["kind"], "emergency_stop");
  EXPECT_EQ(received["command"]["actor"], "token:local");
  page->say({{"type", "emergency_stop"}, {"robot_id", nullptr}});
  EXPECT_EQ(commands(rheonaut_Command_emergency_stop_tag).size(), 2U);
}

TEST_F(LiveSocketTest, AnEchoComesBackAtOnce) {
  const auto page = open_page();
  page->receive("welcome");
  page->say({{"type", "echo"}, {"stamp_us", 4711}});
  EXPECT_EQ(page->next(), (json{{"type", "echo"}, {"stamp_us", 4711}})) << "ahead of the next stamp";
  page->say({{"type", "echo"}});
  EXPECT_EQ(page->receive("problem")["problem"]["status"], 400);
}

TEST_F(LiveSocketTest, TheWayOfAStopIsNullWhereItIsNotMeasured) {
  connect_robot();
  EXPECT_EQ(open_page()->receive("welcome")["robots"][0]["stop_path"], nullptr) << "its firmware answers no probes";
}

TEST_F(LiveSocketTest, AStopIsObeyedWhateverElseTheMessageSays) {
  connect_robot();
  const auto page = open_page();
  std::size_t stops = 0;
  for (const json& message :
       {json{{"robot_id", "r1"}, {"why", json::array({1, 2})}}, json{{"robot_id", "r1"}, {"key", 7}},
        json{{"robot_id", "r1"}, {"key", "no key at all"}}, json{{"robot_id", nullptr}, {"robots", "all"}}}) {
    json stop = message;
    stop["type"] = "emergency_stop";
    page->say(stop);
    EXPECT_EQ(commands(rheonaut_Command_emergency_stop_tag).size(), ++stops) << stop;
  }
  page->say_text(R"({"type":"emergency_stop","key":"a","key":"b","robot_id":"r1","robot_id":"r1"})");
  EXPECT_EQ(commands(rheonaut_Command_emergency_stop_tag).size(), ++stops);
  page->say_text(R"({"type":"keep_alive","stamp_us":1,"stamp_us":2})");
  EXPECT_EQ(page->receive("problem")["problem"]["reason"], "repeated_member");
}

TEST_F(LiveSocketTest, AStopIsObeyedFromAPageThatDoesNotRead) {
  connect_robot();
  const auto page = open_page();
  station::SampleBatch batch;
  batch.robot_id = "r1";
  batch.boot_id = 77;
  batch.samples.resize(25);
  for (int i = 0; i < 2000; ++i) live.on_samples(*station.find("r1"), batch);
  clock.settle();
  page->say({{"type", "emergency_stop"}, {"robot_id", "r1"}});
  EXPECT_EQ(commands(rheonaut_Command_emergency_stop_tag).size(), 1U);
}

TEST_F(LiveSocketTest, RenewsALeaseWithAFreshStampOnly) {
  connect_robot();
  const auto page = open_page();
  const auto renew = [&](std::int64_t stamp_us) {
    page->say({{"type", "renew_lease"}, {"robot_id", "r1"}, {"stamp_us", stamp_us}});
  };
  renew(clock.steady_us() - 400'000);
  EXPECT_EQ(commands(rheonaut_Command_renew_lease_tag).size(), 1U);
  renew(clock.steady_us() - 400'001);
  EXPECT_EQ(page->receive("problem")["problem"]["reason"], "stale");
  renew(clock.steady_us() + 1);
  EXPECT_EQ(page->receive("problem")["problem"]["reason"], "stale");
  EXPECT_EQ(commands(rheonaut_Command_renew_lease_tag).size(), 1U);
}

// SAFETY: a tab and its copy, with the same id in its storage, are two clients.
TEST_F(LiveSocketTest, ATabAndItsCopyAreTwoClients) {
  const auto client_of = [](Page& page) { return page.receive("welcome").value("client", ""); };
  auto copied = open_page("/live?client=tab-one-&page=first-load");
  EXPECT_EQ(client_of(*copied), "tab-one-");
  {
    const auto copy = open_page("/live?client=tab-one-&page=other-load");
    const std::string given = client_of(*copy);
    EXPECT_TRUE(identity::is_client_id(given)) << given;
    EXPECT_NE(given, "tab-one-");
    const auto again = open_page("/live?client=tab-one-&page=first-load");
    EXPECT_EQ(client_of(*again), "tab-one-") << "the first page, whose connection was broken";
    EXPECT_EQ(client_of(*open_page("/live?client=short&page=first-load")), "") << "no id";
    EXPECT_EQ(client_of(*open_page("/live")), "");
  }
  clock.settle();
  EXPECT_NE(client_of(*open_page("/live?client=tab-one-&page=other-load")), "tab-one-") << "the first one is open";
  copied.reset();
  clock.settle();
  EXPECT_EQ(client_of(*open_page("/live?client=tab-one-&page=second-load")), "tab-one-") << "it was loaded again";
}

// SAFETY: a page keeps what it names, and nothing of another page or program of the same actor.
TEST_F(LiveSocketTest, ASignOfLifeIsForWhatItNames) {
  connect_robot();
  const auto page = open_page("/live?client=tab-one-&page=first-load");
  const auto other = open_page("/live?client=tab-two-&page=other-load");
  const auto nameless = open_page();
  const auto say = [&](Page& by, const json& robots) {
    json sign{{"type", "keep_alive"}, {"stamp_us", clock.steady_us()}};
    if (!robots.is_null()) sign["robots"] = robots;
    by.say(sign);
  };
  client = "tab-one-";
  ASSERT_EQ(ask("POST", "/api/v1/robots/r1/control", {{"action", "take"}}).status, 200);
  for (int i = 0; i < 5; ++i) {
    clock.run_for(1s);
    say(*page, {"r1", "r9"});
  }
  EXPECT_EQ(station.holder("r1"), "token:local");
  for (int i = 0; i < 4; ++i) {
    clock.run_for(1s);
    say(*page, json::array({"r2"}));
    say(*other, {"r1"});
    say(*nameless, nullptr);
  }
  EXPECT_EQ(station.holder("r1"), "");

  client = "";
  ASSERT_EQ(ask("POST", "/api/v1/robots/r1/control", {{"action", "take"}}).status, 200);
  for (int i = 0; i < 5; ++i) {
    clock.run_for(1s);
    say(*nameless, nullptr);
  }
  EXPECT_EQ(station.holder("r1"), "token:local") << "a client without an id counts for the control that it holds";
  page->say({{"type", "keep_alive"}, {"robots", {1}}});
  EXPECT_EQ(page->receive("problem")["problem"]["reason"], "malformed");
  page->say({{"type", "keep_alive"}, {"experiments", {-1}}});
  EXPECT_EQ(page->receive("problem")["problem"]["reason"], "malformed");
}

TEST_F(LiveSocketTest, OnlyTheClientThatHoldsADutyRenewsIt) {
  connect_robot();
  client = "tab-one-";
  ASSERT_EQ(ask("POST", "/api/v1/robots/r1/control", {{"action", "take"}}).status, 200);
  const auto renew = [&](Page& by) {
    by.say({{"type", "renew_lease"}, {"robot_id", "r1"}, {"stamp_us", clock.steady_us()}});
  };
  const auto other = open_page("/live?client=tab-two-&page=other-load");
  renew(*other);
  EXPECT_EQ(commands(rheonaut_Command_renew_lease_tag).size(), 0U);
  const auto page = open_page("/live?client=tab-one-&page=first-load");
  renew(*page);
  EXPECT_EQ(commands(rheonaut_Command_renew_lease_tag).size(), 1U);
}

TEST_F(LiveSocketTest, APageReceivesTheSamplesOfTheRobotsItWatches) {
  connect_robot();
  const auto page = open_page();
  page->say({{"type", "watch"}, {"robots", {"r2"}}});
  clock.settle();
  make_samples(*robot, 0, 5);
  page->say({{"type", "emergency_stop"}, {"robot_id", "r1"}});
  clock.run_for(200ms);
  const json log = page->receive("log");
  ASSERT_EQ(log["commands"].size(), 1U) << log << ": with the next stamp, of every robot";
  EXPECT_EQ(log["commands"][0]["robot_id"], "r1");
  page->say({{"type", "watch"}, {"robots", {"r1", "r2"}}});
  clock.settle();
  make_samples(*robot, 5, 5);
  EXPECT_EQ(page->receive("samples")["first_seq"], 5);
  for (const json& robots :
       {json("r1"), json{1}, json(std::vector<std::string>(65, "r1")), json{std::string(32, 'r')}}) {
    page->say({{"type", "watch"}, {"robots", robots}});
    EXPECT_EQ(page->receive("problem")["problem"]["reason"], "malformed");
  }
}

// When a page begins to watch a robot it receives what it missed of that robot.
TEST_F(LiveSocketTest, APageReceivesTheStateOfARobotThatItBeginsToWatch) {
  connect_robot();
  const auto page = open_page();
  page->say({{"type", "watch"}, {"robots", json::array()}});
  clock.settle();
  ASSERT_TRUE(station.control(
      {"r1", "session:7", "", station::ControlAction::take, station::kControlLease, "", microseconds{0}}));
  clock.run_for(200ms);
  page->receive("log");
  page->say({{"type", "watch"}, {"robots", {"r1"}}});
  clock.run_for(200ms);
  EXPECT_EQ(page->receive("robot")["robot"]["control"]["holder"], "session:7");
}

TEST_F(LiveSocketTest, SaysWhatItDoesNotUnderstand) {
  connect_robot();
  const auto page = open_page();
  const struct {
    const char* text;
    const char* reason;
  } cases[] = {{"nonsense", "malformed_json"},
               {R"({"type":"dance"})", "unknown_type"},
               {R"({"kind":"ping"})", "missing_member"},
               {R"({"type":"emergency_stop","robot_id":"r9"})", "unknown_robot"},
               {R"({"type":"emergency_stop"})", "missing_member"},
               {R"({"type":"renew_lease","robot_id":"r1"})", "missing_member"},
               {R"({"type":"keep_alive","extra":1})", "unknown_member"}};
  for (const auto& one : cases) {
    page->say_text(one.text);
    EXPECT_EQ(page->receive("problem")["problem"]["reason"], one.reason) << one.text;
  }
  page->say({{"type", "keep_alive"}});
  EXPECT_FALSE(page->closed());
}

TEST_F(LiveSocketTest, RefusesAMessageOverFourKilobytes) {
  const auto page = open_page();
  page->say_text(std::string(5000, ' '));
  page->receive("nothing");
  EXPECT_EQ(page->close_code, 1009);
  EXPECT_TRUE(page->closed());
}

TEST_F(LiveSocketTest, LetsASilentPageGo) {
  const auto page = open_page();
  page->answers_pings = false;
  clock.run_for(31s);
  page->receive("nothing");
  EXPECT_EQ(page->close_code, 1008);
  EXPECT_GE(page->pings, 1);
  EXPECT_TRUE(page->closed());
}

TEST_F(LiveSocketTest, KeepsAPageThatAnswersPings) {
  const auto page = open_page();
  for (int i = 0; i < 12; ++i) {
    clock.run_for(5s);
    EXPECT_FALSE(page->receive("stamp").is_null());
    while (page->receive("stamp")["stamp_us"] < clock.steady_us() - 100'000) continue;
  }
  EXPECT_GE(page->pings, 3);
  EXPECT_FALSE(page->closed());
}

// While it is broken it throws at everything that becomes of a command.
class BrokenSink final : public station::StationSink {
 public:
  void on_robot(const station::RobotState&) override {}
  void on_samples(const station::RobotState&, const station::SampleBatch&) override {}
  void on_event(const station::RobotState&, const station::RobotEvent&) override {}
  void on_command(const station::CommandRecord&) override {
    if (is_broken) throw std::runtime_error{"the sink is broken"};
  }
  bool is_broken = false;
};

TEST_F(LiveSocketTest, AnExceptionBehindAMessageEndsNeitherPageNorStation) {
  connect_robot();
  static BrokenSink sink;  // outlives the station
  sink.is_broken = true;
  station.add_sink(sink);
  const auto page = open_page();
  page->receive("welcome");
  page->say({{"type", "emergency_stop"}, {"robot_id", "r1"}});
  page->say({{"type", "emergency_stop"}, {"robot_id", nullptr}});
  page->say({{"type", "renew_lease"}, {"robot_id", "r1"}, {"stamp_us", clock.steady_us()}});
  EXPECT_FALSE(tasks.stopping());
  EXPECT_EQ(tasks.exit_code(), 0);
  page->say_text("nonsense");
  EXPECT_EQ(page->receive("problem")["problem"]["reason"], "malformed_json");
  const Answered answered = ask("POST", "/api/v1/emergency-stop");
  sink.is_broken = false;
  EXPECT_EQ(answered.status, 500) << answered.body;
  EXPECT_NE(answered.parsed()["detail"].get<std::string>().find("r1"), std::string::npos) << answered.body;
}

TEST_F(LiveSocketTest, EndsWhenTheStationStopsAndWhenThePageLeaves) {
  {
    const auto leaving = open_page();
  }
  clock.settle();
  const auto page = open_page();
  page->receive("welcome");
  tasks.stop();
  clock.settle();
  page->receive("nothing");
  EXPECT_EQ(page->close_code, 1001);
  EXPECT_TRUE(page->closed());
}

}  // namespace
}  // namespace server
