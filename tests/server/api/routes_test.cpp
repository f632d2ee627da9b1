// Robots, commands, stops and runs through the routes, with the real station and recorder and a hand-made robot.
#include <SQLiteCpp/SQLiteCpp.h>

#include <ctime>

#include "server/http/router.hpp"
#include "server/live/live_feed.hpp"
#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

class RoutesTest : public ApiTest {
 protected:
  const json ping{{"kind", "ping"}};

  // What a station would find that was started now, after a kill.
  int stops_on_disk() const {
    const SQLite::Database database{(folder.path() / "station.sqlite").string(), SQLite::OPEN_READONLY};
    SQLite::Statement count{database, "SELECT count(*) FROM command WHERE kind = 'emergency_stop'"};
    count.executeStep();
    return count.getColumn(0).getInt();
  }
};

TEST_F(RoutesTest, StationSaysWhatItIs) {
  clock.run_for(2s);
  const json station_json = ask("GET", "/api/v1/station").parsed();
  EXPECT_EQ(station_json["version"], "0.1.0");
  EXPECT_EQ(station_json["store_id"], "18364758544493064720");
  EXPECT_EQ(station_json["http_address"], "127.0.0.1:" + std::to_string(port()));
  EXPECT_GE(station_json["uptime_s"], 2.0);
}

TEST_F(RoutesTest, RobotsAreListedWithTheirState) {
  EXPECT_EQ(ask("GET", "/api/v1/robots").parsed(), (json{{"robots", json::array()}}));
  connect_robot();
  make_samples(*robot, 0, 5);
  const json listed = ask("GET", "/api/v1/robots").parsed()["robots"][0];
  EXPECT_EQ(listed["robot_id"], "r1");
  EXPECT_EQ(listed["link"], "connected");
  EXPECT_EQ(listed["boot_id"], "77");
  EXPECT_EQ(listed["mode"], "manual");
  EXPECT_EQ(listed["next_seq"], 5);
  EXPECT_EQ(listed["sample"]["position_m"], 4);
  EXPECT_EQ(listed["emergency_id"], nullptr);
  EXPECT_EQ(ask("GET", "/api/v1/robots/r1").parsed()["robot_id"], "r1");
}

TEST_F(RoutesTest, AnUnknownRobotIsNotFound) {
  for (const char* target : {"/api/v1/robots/r9", "/api/v1/robots/r9/commands", "/api/v1/robots/r9/events"}) {
    const Answered answered = ask("GET", target);
    EXPECT_EQ(answered.status, 404) << target;
    EXPECT_EQ(answered.parsed()["reason"], "unknown_robot");
    EXPECT_EQ(answered.response.content_type, "application/problem+json");
  }
  EXPECT_EQ(ask("POST", "/api/v1/robots/r9/commands", ping).status, 404);
  EXPECT_EQ(ask("POST", "/api/v1/robots/r9/emergency-stop").status, 404);
}

TEST_F(RoutesTest, AnAcknowledgedCommandIs200WithItsRecord) {
  connect_robot();
  const auto asked = begin("POST", "/api/v1/robots/r1/commands", {{"kind", "set_duty"}, {"duty", 0.25}});
  ASSERT_EQ(robot->commands().size(), 1U);
  EXPECT_EQ(robot->commands()[0].action.set_duty.duty, 0.25F);
  robot->acknowledge(robot->commands()[0], rheonaut_COMMAND_RESULT_ACCEPTED);
  const Answered answered = end(asked);
  EXPECT_EQ(answered.status, 200);
  const json record = answered.parsed();
  EXPECT_EQ(record["state"], "acknowledged");
  EXPECT_EQ(record["arguments"], (json{{"duty", 0.25}}));
  EXPECT_EQ(record["actor"], "token:local");
  EXPECT_EQ(record["command_id"], std::to_string(robot->commands()[0].command_id));
  const std::string id = record["command_id"];
  EXPECT_EQ(ask("GET", "/api/v1/commands/" + id).parsed()["state"], "acknowledged");
  EXPECT_EQ(ask("GET", "/api/v1/robots/r1/commands?limit=5").parsed()["commands"].size(), 1U);
  EXPECT_EQ(ask("GET", "/api/v1/robots/r1/commands?renewals=counted").parsed()["commands"].size(), 1U);
  EXPECT_EQ(ask("GET", "/api/v1/robots/r1/commands?renewals=some").parsed()["detail"],
            "renewals = 'some' is not true, false or counted");
}

TEST_F(RoutesTest, ARefusedCommandIs409WithReasonAndRecord) {
  connect_robot();
  const auto asked = begin("POST", "/api/v1/robots/r1/commands", ping);
  robot->acknowledge(robot->commands().at(0), rheonaut_COMMAND_RESULT_REJECTED, 0, rheonaut_REJECT_REASON_WRONG_MODE);
  const Answered answered = end(asked);
  EXPECT_EQ(answered.status, 409);
  EXPECT_EQ(answered.parsed()["reason"], "wrong_mode");
  EXPECT_EQ(answered.parsed()["command"]["state"], "rejected");
}

TEST_F(RoutesTest, ACommandWithoutAnswerIs504) {
  connect_robot();
  const Answered answered = ask("POST", "/api/v1/robots/r1/commands", ping);
  EXPECT_EQ(answered.status, 504);
  EXPECT_EQ(answered.parsed()["command"]["state"], "unknown");
  EXPECT_EQ(answered.parsed()["reason"], "no_answer");
}

TEST_F(RoutesTest, ACommandForAnAbsentRobotIs409) {
  station.restore({{"r2", 0, 0}}, {});
  const Answered answered = ask("POST", "/api/v1/robots/r2/commands", ping);
  EXPECT_EQ(answered.status, 409);
  EXPECT_EQ(answered.parsed()["reason"], "not_connected");
}

TEST_F(RoutesTest, AValueOutsideTheLimitsIs422AndSaysThem) {
  connect_robot();
  const Answered answered = ask("POST", "/api/v1/robots/r1/commands", {{"kind", "set_setpoint"}, {"setpoint_m", 1.5}});
  EXPECT_EQ(answered.status, 422);
  EXPECT_EQ(answered.parsed()["detail"], "setpoint_m = 1.5 is outside -1 to 1");
}

TEST_F(RoutesTest, AnAcknowledgedStopIs200) {
  connect_robot();
  const auto asked = begin("POST", "/api/v1/robots/r1/emergency-stop");
  ASSERT_EQ(robot->commands().size(), 1U);
  robot->acknowledge(robot->commands()[0], rheonaut_COMMAND_RESULT_ACCEPTED, 99);
  const Answered answered = end(asked);
  EXPECT_EQ(answered.status, 200);
  EXPECT_EQ(answered.parsed()["emergency_id"], "99");
  EXPECT_EQ(ask("GET", "/api/v1/robots/r1").parsed()["emergency_id"], "99");
}

TEST_F(RoutesTest, AStopForAnAbsentRobotIs202AtOnce) {
  station.restore({{"r2", 0, 0}}, {});
  const std::int64_t before_us = clock.steady_us();
  const Answered answered = ask("POST", "/api/v1/robots/r2/emergency-stop");
  EXPECT_EQ(answered.status, 202);
  EXPECT_EQ(answered.parsed()["state"], "queued");
  EXPECT_LT(clock.steady_us() - before_us, 10'000);
}

TEST_F(RoutesTest, AStopThatNobodyAnswersIs202) {
  connect_robot();
  EXPECT_EQ(ask("POST", "/api/v1/robots/r1/emergency-stop").status, 202);
}

TEST_F(RoutesTest, AKeptStopIsOnDiskBeforeItIsAnswered) {
  station.restore({{"r2", 0, 0}, {"r3", 0, 0}}, {});
  ASSERT_EQ(ask("POST", "/api/v1/robots/r2/emergency-stop").status, 202);
  EXPECT_EQ(stops_on_disk(), 1);
  ASSERT_EQ(ask("POST", "/api/v1/emergency-stop").status, 202);
  EXPECT_GE(stops_on_disk(), 2);
}

TEST_F(RoutesTest, AnAcknowledgedStopDoesNotWaitForTheDisk) {
  connect_robot();
  clock.run_for(500ms);
  const auto asked = begin("POST", "/api/v1/robots/r1/emergency-stop");
  const auto commits = recorder.counters().commits;
  robot->acknowledge(robot->commands().at(0), rheonaut_COMMAND_RESULT_ACCEPTED, 99);
  clock.settle();
  EXPECT_EQ(end(asked).status, 200);
  EXPECT_EQ(recorder.counters().commits, commits);
}

TEST_F(RoutesTest, StopAllReachesEveryRobotBeforeItWaitsForAny) {
  connect_robot();
  station.restore({{"a-silent-one", 0, 0}, {"r2", 0, 0}}, {});
  const auto asked = begin("POST", "/api/v1/emergency-stop");
  ASSERT_EQ(robot->commands().size(), 1U);
  robot->acknowledge(robot->commands()[0], rheonaut_COMMAND_RESULT_ACCEPTED, 99);
  const Answered answered = end(asked);
  EXPECT_EQ(answered.status, 202);
  EXPECT_EQ(answered.parsed()["commands"].size(), 3U);
  for (const char* id : {"a-silent-one", "r2"}) EXPECT_TRUE(station.find(id)->pending_stop) << id;
}

TEST_F(RoutesTest, WhatIsLostAndWhatHasNotComeIsListed) {
  robot = std::make_unique<TestRobot>(loop, clock, tasks, robots);
  protocol::RobotFrame hello = TestRobot::hello_frame();
  hello.body.hello.oldest_seq = 10;
  hello.body.hello.next_seq = 15;
  robot->send(hello);
  ASSERT_TRUE(clock.run_until([&] { return !robot->welcomes().empty(); }, 1s));
  const json found = ask("GET", "/api/v1/robots/r1/gaps").parsed();
  ASSERT_EQ(found["gaps"].size(), 1U) << found;
  const json& gap = found["gaps"][0];
  EXPECT_EQ(gap["boot_id"], "77");
  EXPECT_EQ(gap["first_seq"], 0);
  EXPECT_EQ(gap["last_seq"], 9);
  EXPECT_EQ(gap["cause"], "ring_overrun");
  EXPECT_EQ(found["missing"], json::array({{{"boot_id", "77"}, {"first_seq", 10}, {"last_seq", 14}}}));
  EXPECT_EQ(found["next"], nullptr);
}

TEST_F(RoutesTest, ARunHoldsWhatWasMadeBetweenItsBeginAndItsEnd) {
  connect_robot();
  make_samples(*robot, 0, 5);
  const Answered created =
      ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "first"}, {"fluid", "water"}, {"profile", "square"}});
  ASSERT_EQ(created.status, 201) << created.body;
  const std::string path = "/api/v1/runs/" + std::to_string(created.parsed()["run_id"].get<int>());
  make_samples(*robot, 5, 5);
  make_samples(*robot, 10, 5);
  EXPECT_EQ(ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "second"}}).status, 409);
  const Answered ended = ask("POST", path + "/end", {{"verdict", "good"}});
  ASSERT_EQ(ended.status, 200) << ended.body;
  EXPECT_EQ(ended.parsed()["verdict"], "good");
  EXPECT_EQ(created.parsed()["state"], "open");
  EXPECT_EQ(ended.parsed()["state"], "ended");
  EXPECT_EQ(ended.parsed()["made_by"], "token:local");
  EXPECT_EQ(ended.parsed()["made_afterwards"], false);
  EXPECT_EQ(ended.parsed()["profile"], "square");
  EXPECT_EQ(ended.parsed()["samples_stored"], 10);
  EXPECT_EQ(ask("GET", path).parsed()["fluid"], "water");
  EXPECT_EQ(ask("GET", "/api/v1/runs?robot_id=r1").parsed()["runs"].size(), 1U);
  EXPECT_EQ(ask("GET", "/api/v1/runs?robot_id=r9").parsed()["runs"].size(), 0U);

  const json first = ask("GET", path + "/samples?limit=6").parsed();
  ASSERT_EQ(first["samples"].size(), 6U);
  EXPECT_EQ(first["samples"][0]["seq"], 5);
  EXPECT_EQ(first["samples"][0]["position_m"], 5);
  EXPECT_EQ(first["samples"][0]["clock_uncertainty_us"], -1);
  EXPECT_LE(first["samples"][0]["first_received_at_us"], first["samples"][0]["received_at_us"]);
  EXPECT_EQ(first["samples"][0]["controller_id"], 0);
  EXPECT_EQ(first["samples"][0]["emergency_id"], nullptr);
  EXPECT_EQ(first["samples"][0]["emergency_cause"], "none");
  EXPECT_EQ(first["samples"][0]["flags"], 0);
  ASSERT_TRUE(first["next"].is_string());
  const json rest = ask("GET", path + "/samples?after=" + first["next"].get<std::string>()).parsed();
  ASSERT_EQ(rest["samples"].size(), 4U);
  EXPECT_EQ(rest["samples"][0]["seq"], 11);
  EXPECT_EQ(rest["next"], nullptr);

  const std::string csv = ask("GET", path + "/samples.csv").body;
  EXPECT_EQ(std::ranges::count(csv, '\n'), 11);
  EXPECT_TRUE(csv.starts_with("span,boot_id,seq,robot_time_us,t_s,utc,position_m,velocity_m_s,"));
  EXPECT_NE(csv.find("\n0,77,5,"), std::string::npos) << csv;
  EXPECT_NE(csv.find("Z,14,0,0,0,0,0,manual,none,,0,"), std::string::npos) << csv;
  EXPECT_EQ(ask("GET", path + "/gaps").parsed(),
            (json{{"gaps", json::array()}, {"missing", json::array()}, {"next", nullptr}}));
  EXPECT_EQ(ask("GET", path + "/gaps?limit=0").status, 400);
  EXPECT_EQ(ask("GET", path + "/gaps?after=x").status, 400);
}

// While a segment waits for more samples, when it is complete, and when it is on disk.
TEST_F(RoutesTest, WhenASampleWasReceivedNeverChanges) {
  connect_robot();
  std::map<std::uint64_t, std::pair<json, json>> known;
  std::size_t unknown = 0;
  const auto read = [&] {
    unknown = 0;
    const json page = ask("GET", "/api/v1/robots/r1/samples?limit=10000").parsed();
    for (const json& sample : page["samples"]) {
      EXPECT_FALSE(sample["first_received_at_us"].is_null());
      const std::pair<json, json> received{sample["first_received_at_us"], sample["received_at_us"]};
      const auto seq = sample["seq"].get<std::uint64_t>();
      unknown += received.second.is_null() ? 1 : 0;
      const auto [at, is_new] = known.emplace(seq, received);
      if (is_new) continue;
      EXPECT_EQ(at->second.first, received.first) << seq;
      if (at->second.second.is_null()) at->second.second = received.second;
      EXPECT_EQ(at->second.second, received.second) << seq;
    }
  };
  for (std::uint64_t seq = 0; seq < 250; seq += 5) {
    make_samples(*robot, seq, 5);
    clock.run_for(50ms);
    read();
    EXPECT_LE(unknown, 100U) << "more than the last segment";
  }
  EXPECT_GT(known.size(), unknown);
  clock.run_for(3s);
  read();
  EXPECT_EQ(unknown, 0U);
}

TEST_F(RoutesTest, ARunInManualHasNoSteps) {
  connect_robot();
  ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "manual"}});
  make_samples(*robot, 0, 25);
  EXPECT_EQ(ask("GET", "/api/v1/runs/1/step-metrics").parsed(),
            (json{{"steps", json::array()}, {"reference", nullptr}, {"estimate_error", nullptr}}));
  EXPECT_EQ(ask("GET", "/api/v1/runs/99/step-metrics").status, 404);
}

TEST_F(RoutesTest, CsvOfALongRunComesInPieces) {
  connect_robot();
  const Answered created = ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "long"}});
  for (std::uint64_t seq = 0; seq < 5000; seq += 25) make_samples(*robot, seq, 25);
  const std::string path = "/api/v1/runs/" + std::to_string(created.parsed()["run_id"].get<int>());
  EXPECT_EQ(std::ranges::count(ask("GET", path + "/samples.csv").body, '\n'), 5001);
}

// How long this thread has worked.
std::int64_t worked_us() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return time.tv_sec * 1'000'000 + time.tv_nsec / 1000;
}

boost::asio::awaitable<void> fetch(const http::Router& router, std::string target, std::optional<std::string>& into) {
  http::Request request;
  request.method = "GET";
  request.target = std::move(target);
  request.caller.scopes = identity::Scopes::of(identity::Role::operator_);
  http::Response response = co_await router.dispatch(std::move(request));
  std::string text = std::move(response.body);
  if (response.stream != nullptr) {
    const auto piece = co_await response.stream->next();
    if (piece && *piece) text = **piece;
  }
  into = std::move(text);
}

// The longest that the loop worked without a break is small beside the reading of the same text.
TEST_F(RoutesTest, TheTextOfManySamplesIsNotMadeOnTheLoop) {
  connect_robot();
  ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "long"}});
  for (std::uint64_t seq = 0; seq < 10'000; seq += 25) make_samples(*robot, seq, 25);
  const auto longest_us = [&](const char* target, std::string& text) {
    std::optional<std::string> answer;
    tasks.spawn("fetch", fetch(router(), target, answer));
    std::int64_t longest = 0;
    const auto patience = std::chrono::steady_clock::now() + 60s;
    while (!answer && std::chrono::steady_clock::now() < patience) {
      const std::int64_t before_us = worked_us();
      loop.poll_one();
      longest = std::max(longest, worked_us() - before_us);
    }
    text = answer.value_or("");
    return longest;
  };
  ask("POST", "/api/v1/runs/1/end");  // commits the samples
  std::string text;
  const std::int64_t json_us = longest_us("/api/v1/runs/1/samples?limit=10000", text);
  const std::int64_t before_us = worked_us();
  const json page = json::parse(text);
  const std::int64_t parse_us = worked_us() - before_us;
  ASSERT_EQ(page.at("samples").size(), 10'000U);
  EXPECT_LT(json_us, parse_us / 4);
  const std::int64_t csv_us = longest_us("/api/v1/runs/1/samples.csv", text);
  EXPECT_NEAR(static_cast<double>(std::ranges::count(text, '\n')), 2001, 100);  // less the page's last segment
  EXPECT_LT(csv_us, parse_us / 20);                                             // a fifth of the samples
}

TEST_F(RoutesTest, BadRunRequestsAreRefused) {
  connect_robot();
  EXPECT_EQ(ask("POST", "/api/v1/runs", {{"robot_id", "r9"}, {"name", "x"}}).status, 404);
  EXPECT_EQ(ask("POST", "/api/v1/runs", {{"robot_id", "r1"}}).status, 400);
  EXPECT_EQ(ask("GET", "/api/v1/runs/99").status, 404);
  EXPECT_EQ(ask("GET", "/api/v1/runs/99/samples").status, 404);
  EXPECT_EQ(ask("GET", "/api/v1/runs/99/samples.csv").status, 404);
  EXPECT_EQ(ask("POST", "/api/v1/runs/99/end").status, 404);
  EXPECT_EQ(ask("GET", "/api/v1/runs/x").status, 400);
  EXPECT_EQ(ask("GET", "/api/v1/runs?limit=0").status, 400);
  EXPECT_EQ(ask("GET", "/api/v1/runs?limit=1001").status, 400);
  EXPECT_EQ(ask("GET", "/api/v1/runs/1/samples?after=x").status, 400);
  EXPECT_EQ(ask("GET", "/api/v1/runs/99").parsed()["reason"], "not_found") << "no reason of its own";
  EXPECT_EQ(ask("GET", "/api/v1/commands/0").status, 400);
  EXPECT_EQ(ask("GET", "/api/v1/commands/5").status, 404);
}

TEST_F(RoutesTest, EventsComeNewestFirst) {
  connect_robot();
  clock.run_for(1s);
  const json events = ask("GET", "/api/v1/robots/r1/events?limit=1").parsed()["events"];
  ASSERT_EQ(events.size(), 1U);
  EXPECT_EQ(events[0]["kind"], "connected");
  EXPECT_EQ(events[0]["event_seq"], nullptr);
}

// As an experiment makes and ends them, past the routes.
TEST_F(RoutesTest, PagesHearOfRunsThatNoRequestMakes) {
  connect_robot();
  live::Subscriber page{loop};
  live.add(page);
  const auto make = [this]() -> boost::asio::awaitable<void> {
    storage::RunConditions conditions;
    conditions.name = "of an experiment";
    const auto run = co_await recording.runs.create("r1", std::move(conditions));
    if (run) co_await recording.runs.end(run->id, "done");
  };
  tasks.spawn("an experiment", make());
  clock.run_for(5s);
  std::vector<json> states;
  for (live::LiveText text = page.pop(); text != nullptr; text = page.pop()) {
    const json message = json::parse(*text);
    if (message["type"] == "run") states.push_back(message["run"]["state"]);
  }
  EXPECT_EQ(states, (std::vector<json>{"open", "ended"}));
  live.remove(page);
}

TEST_F(RoutesTest, PagesHearOfRuns) {
  connect_robot();
  live::Subscriber page{loop};
  live.add(page);
  ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "first"}});
  bool found = false;
  for (live::LiveText text = page.pop(); text != nullptr; text = page.pop())
    found |= json::parse(*text)["type"] == "run";
  EXPECT_TRUE(found);
  live.remove(page);
}

}  // namespace
}  // namespace server
