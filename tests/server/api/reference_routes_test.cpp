// A run's position from outside, over the routes: what is kept, what is refused, and bodies over 64 kB.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>

#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

using ::testing::HasSubstr;

class ReferenceRoutesTest : public ApiTest {
 protected:
  static constexpr const char* kPath = "/api/v1/runs/1/reference";

  // Run 1 has samples 0 to 499, whose positions are the robot's.
  void record(std::optional<std::uint64_t> zeroed_at_seq = {}) {
    connect_robot();
    ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "first"}});
    for (std::uint64_t seq = 0; seq < 500; seq += 25) {
      if (seq == zeroed_at_seq) report_zeroing();
      make_samples(*robot, seq, 25);
      clock.run_for(250ms);
    }
    ASSERT_EQ(ask("POST", "/api/v1/runs/1/end").status, 200);
  }
  void report_zeroing() {
    protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
    frame.which_body = rheonaut_RobotFrame_event_tag;
    frame.body.event.kind = rheonaut_EVENT_KIND_POSITION_ZEROED;
    frame.body.event.cause = rheonaut_EVENT_CAUSE_COMMAND;
    frame.body.event.mode = rheonaut_MODE_MANUAL;
    frame.body.event.event_robot_time_us = robot->robot_now_us();
    robot->send(frame);
  }
  static json body(int rows = 100) {
    std::string csv = "t_s,position_m\n";
    for (int k = 0; k < rows; ++k) csv += fmt::format("{},{}\n", k / 30.0, 0.001 * k);
    return {{"csv", csv},
            {"source", "camera.csv"},
            {"sd_m", 0.0005},
            {"keep_zero", true},
            {"clock", {{"method", "offset"}, {"offset_s", 0.01}}}};
  }
  Answered import(const json& given) { return ask("POST", kPath, given); }
};

TEST_F(ReferenceRoutesTest, IsStoredBesideTheRunAndShown) {
  record();
  const json digest = ask("GET", "/api/v1/runs/1/certificate").parsed();
  EXPECT_EQ(ask("GET", kPath).status, 404);
  const Answered made = import(body());
  ASSERT_EQ(made.status, 201) << made.body;
  const json found = ask("GET", kPath).parsed();
  EXPECT_EQ(found, made.parsed());
  EXPECT_EQ(found["source"], "camera.csv");
  EXPECT_EQ(found["clock_method"], "offset");
  EXPECT_EQ(found["clock_sd_s"], nullptr);
  EXPECT_EQ(found["zero_is_kept"], true);
  EXPECT_EQ(found["samples"], 100);
  EXPECT_EQ(found["sha256"].get<std::string>().size(), 64U);
  EXPECT_THAT(found["in_words"].get<std::string>(), HasSubstr("zero kept"));

  const json positions = ask("GET", std::string{kPath} + "/positions?limit=60").parsed();
  ASSERT_EQ(positions["position_m"].size(), 60U);
  EXPECT_EQ(positions["position_m"][59], 0.001 * 59);
  EXPECT_EQ(positions["position_sd_m"][0], 0.0005);
  const json rest =
      ask("GET", fmt::format("{}/positions?limit=60&after={}", kPath, positions["next"].get<std::int64_t>())).parsed();
  EXPECT_EQ(rest["position_m"].size(), 40U);
  EXPECT_EQ(rest["next"], nullptr);
  const json samples = ask("GET", "/api/v1/runs/1/samples?limit=1").parsed();
  EXPECT_EQ(positions["robot_time_us"][0].get<std::int64_t>(),
            samples["samples"][0]["robot_time_us"].get<std::int64_t>() + 10'000);
  EXPECT_EQ(ask("GET", "/api/v1/runs/1/certificate").parsed(), digest);  // the digest is of the run alone
}

TEST_F(ReferenceRoutesTest, ARunInWhichTheRobotSaysThatItWasZeroedTakesNone) {
  record(250);
  const Answered refused = import(body());
  EXPECT_EQ(refused.status, 422) << refused.body;
  EXPECT_EQ(refused.parsed()["reason"], "zeroed");
  EXPECT_THAT(refused.parsed()["detail"].get<std::string>(), HasSubstr("2.50 s"));
}

TEST_F(ReferenceRoutesTest, IsReplacedAndRemovedWithAReason) {
  record();
  ASSERT_EQ(import(body()).status, 201);
  const Answered second = import(body(50));
  EXPECT_EQ(second.status, 409);
  EXPECT_EQ(second.parsed()["reason"], "has_reference");
  json replacing = body(50);
  replacing["reason"] = "the camera was moved";
  ASSERT_EQ(import(replacing).status, 201);
  EXPECT_EQ(ask("GET", kPath).parsed()["samples"], 50);
  EXPECT_EQ(ask("POST", std::string{kPath} + "/remove").status, 400);
  ASSERT_EQ(ask("POST", std::string{kPath} + "/remove", {{"reason", "of another run"}}).status, 200);
  EXPECT_EQ(ask("GET", kPath).status, 404);
  EXPECT_EQ(ask("POST", std::string{kPath} + "/remove", {{"reason", "again"}}).status, 404);
  const json entries = ask("GET", "/api/v1/audit?action=run").parsed()["entries"];
  std::string actions;
  for (const json& entry : entries) actions += entry["action"].get<std::string>() + " ";
  EXPECT_THAT(actions, HasSubstr("run.reference_removed run.reference_imported run.reference_imported"));
}

TEST_F(ReferenceRoutesTest, AnOpenADiscardedAndAnUnknownRunTakeNone) {
  record();
  ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "open"}});
  EXPECT_EQ(ask("POST", "/api/v1/runs/2/reference", body()).status, 409);
  EXPECT_EQ(ask("POST", "/api/v1/runs/9/reference", body()).status, 404);
  EXPECT_EQ(ask("GET", "/api/v1/runs/9/reference").status, 404);
  ASSERT_EQ(import(body()).status, 201);
  ask("POST", "/api/v1/runs/1/discard", {{"reason", "loose tube"}});
  EXPECT_EQ(ask("GET", kPath).status, 404);
  EXPECT_EQ(import(body()).status, 409);
}

TEST_F(ReferenceRoutesTest, AMarkerOfTheRunTiesTheClock) {
  record();
  const json samples = ask("GET", "/api/v1/runs/1/samples?limit=1000").parsed()["samples"];
  const json& at = samples[100];
  const Answered marker = ask("POST", "/api/v1/robots/r1/markers", {{"text", "flash"}, {"at_us", at["utc_us"]}});
  ASSERT_EQ(marker.status, 201) << marker.body;
  json tied = body();
  tied["clock"] = {{"method", "marker"}, {"marker_text", "flash"}, {"at_s", 0.5}, {"sd_s", 0.02}};
  const Answered made = import(tied);
  ASSERT_EQ(made.status, 201) << made.body;
  const double marked_s = 1e-6 * static_cast<double>(marker.parsed()["robot_time_us"].get<std::int64_t>() -
                                                     samples[0]["robot_time_us"].get<std::int64_t>());
  EXPECT_NEAR(made.parsed()["clock_offset_s"].get<double>(), marked_s - 0.5, 1e-9);
  EXPECT_EQ(made.parsed()["clock_sd_s"], 0.02);
  tied["reason"] = "again";
  tied["clock"]["marker_text"] = "no such";
  EXPECT_EQ(import(tied).parsed()["reason"], "unknown_marker");
}

TEST_F(ReferenceRoutesTest, WhatIsMalformedIsRefusedByName) {
  record();
  const auto with = [](const char* member, const json& value) {
    json changed = body();
    changed[member] = value;
    return changed;
  };
  const auto clock_of = [&](const json& value) { return with("clock", value); };
  EXPECT_EQ(import(json{{"source", "x"}}).status, 400);
  EXPECT_EQ(import(with("csv", "t_s,position_m\n0,x\n")).status, 422);
  EXPECT_THAT(import(with("csv", "t_s,position_m\n0,x\n")).body, HasSubstr("line 2"));
  EXPECT_EQ(import(with("sd_m", 0)).status, 422);
  EXPECT_EQ(import(with("keep_zero", 1)).status, 400);
  EXPECT_EQ(import(with("metres", "yes")).status, 400);
  EXPECT_EQ(import(with("colour", 1)).status, 400);
  EXPECT_EQ(import(clock_of("offset")).status, 400);
  EXPECT_EQ(import(clock_of({{"method", "sundial"}})).status, 422);
  EXPECT_EQ(import(clock_of({{"method", "offset"}})).status, 400);
  EXPECT_EQ(import(clock_of({{"method", "utc"}, {"zero_at_us", "now"}})).status, 400);
  EXPECT_EQ(import(clock_of({{"method", "marker"}, {"at_s", 1}})).status, 400);
  EXPECT_EQ(import(clock_of({{"method", "marker"}, {"marker_id", 1}})).status, 400);
  EXPECT_EQ(import(clock_of({{"method", "correlation"}, {"from_s", 2}, {"to_s", 1}})).status, 422);
  EXPECT_EQ(import(clock_of({{"method", "correlation"}, {"sd_s", 1}})).status, 400);
  EXPECT_EQ(import(clock_of({{"method", "correlation"}, {"from_s", 1000}, {"to_s", 1001}})).parsed()["reason"],
            "no_correlation");
  EXPECT_EQ(ask("GET", kPath).status, 404);
}

// Positions are read in pieces, and those of a reference that is removed are deleted in pieces.
TEST_F(ReferenceRoutesTest, StepsAreNotMeasuredByAReferenceThatIsNoLongerWhole) {
  record();
  ASSERT_EQ(import(body()).status, 201);
  ASSERT_EQ(ask("GET", "/api/v1/runs/1/step-metrics").status, 200);
  {
    SQLite::Database database{(folder.path() / "station.sqlite").string(), SQLite::OPEN_READWRITE};
    database.exec(
        "DELETE FROM outside_position WHERE robot_time_us < (SELECT avg(robot_time_us) FROM outside_position)");
  }
  const Answered answer = ask("GET", "/api/v1/runs/1/step-metrics");
  EXPECT_EQ(answer.status, 409);
  EXPECT_EQ(answer.parsed()["reason"], "reference_changed");
}

// A caller that may import may send 16 MB to this route; other callers and other routes are limited to 64 kB.
TEST_F(ReferenceRoutesTest, OnlyThisRouteTakesALongBody) {
  record();
  const std::string text = body(60'000).dump();
  ASSERT_GT(text.size(), 1'000'000U);
  const auto send = [&](const std::string& target, std::size_t length, const std::string& bytes) {
    RawClient client{clock, port()};
    client.send(
        fmt::format("POST {} HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {}\r\nConnection: close\r\n"
                    "Content-Type: application/json\r\nContent-Length: {}\r\n\r\n",
                    target, token(), length));
    client.send(bytes);
    return client.read_to_end();
  };
  EXPECT_THAT(send(kPath, text.size(), text), ::testing::StartsWith("HTTP/1.1 201 "));
  EXPECT_THAT(send("/api/v1/runs/1/annotate", text.size(), ""), ::testing::StartsWith("HTTP/1.1 413 "));
  EXPECT_THAT(send(kPath, 17U << 20U, ""), ::testing::StartsWith("HTTP/1.1 413 "));
  const json viewer = ask("POST", "/api/v1/tokens", {{"name", "v"}, {"scopes", "read"}}).parsed();
  RawClient client{clock, port()};
  client.send(
      fmt::format("POST {} HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {}\r\n"
                  "Content-Type: application/json\r\nContent-Length: {}\r\n\r\n",
                  kPath, viewer["secret"].get<std::string>(), text.size()));
  EXPECT_THAT(client.read_to_end(), ::testing::StartsWith("HTTP/1.1 403 "));
  const json refused = ask("GET", "/api/v1/audit?action=request.refused").parsed()["entries"];
  ASSERT_EQ(refused.size(), 1U);
  EXPECT_EQ(refused[0]["actor"], "token:v");
  EXPECT_EQ(refused[0]["subject"], kPath);
}

}  // namespace
}  // namespace server
