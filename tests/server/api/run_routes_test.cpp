// Runs after their end, and markers, through the routes: digest, annotation, discard, runs made afterwards.
#include <fmt/format.h>

#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

class RunRoutesTest : public ApiTest {
 protected:
  // Run 1 has samples 0 to 9.
  void record() {
    connect_robot();
    ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "first"}});
    make_samples(*robot, 0, 10);
    ASSERT_EQ(ask("POST", "/api/v1/runs/1/end").status, 200);
  }
  static json span(std::uint64_t first_seq, std::uint64_t last_seq) {
    return {{"robot_id", "r1"},
            {"name", "afterwards"},
            {"span", {{"boot_id", "77"}, {"first_seq", first_seq}, {"last_seq", last_seq}}}};
  }
};

TEST_F(RunRoutesTest, AnEndedRunHasADigest) {
  record();
  const Answered answered = ask("GET", "/api/v1/runs/1/certificate");
  ASSERT_EQ(answered.status, 200) << answered.body;
  const json digest = answered.parsed();
  EXPECT_EQ(digest["final"], true);
  EXPECT_EQ(digest["format"], 2);
  EXPECT_EQ(digest["samples_expected"], 10);
  EXPECT_EQ(digest["samples_live"], 10);
  EXPECT_EQ(digest["samples_missing"], 0);
  EXPECT_EQ(digest["lost_by_cause"], json::object());
  EXPECT_EQ(digest["sha256"].get<std::string>().size(), 64U);
  EXPECT_EQ(ask("GET", "/api/v1/runs/99/certificate").status, 404);
  ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "open"}});
  EXPECT_EQ(ask("GET", "/api/v1/runs/2/certificate").status, 409);
}

TEST_F(RunRoutesTest, ARunIsMadeAfterwardsBySamplesOrTime) {
  record();
  const Answered by_seq = ask("POST", "/api/v1/runs", span(2, 5));
  ASSERT_EQ(by_seq.status, 201) << by_seq.body;
  EXPECT_EQ(by_seq.parsed()["state"], "ended");
  EXPECT_EQ(by_seq.parsed()["made_afterwards"], true);
  EXPECT_EQ(by_seq.parsed()["samples_stored"], 4);
  json by_time = span(0, 0);
  by_time["span"] = {{"from_us", by_seq.parsed()["started_at_us"]}, {"to_us", by_seq.parsed()["ended_at_us"]}};
  clock.run_for(10s);  // the hand-made robot's clock is ahead
  const Answered same = ask("POST", "/api/v1/runs", by_time);
  ASSERT_EQ(same.status, 201) << same.body;
  EXPECT_EQ(same.parsed()["spans"], by_seq.parsed()["spans"]);
  EXPECT_EQ(ask("GET", "/api/v1/runs/2/certificate").parsed()["sha256"],
            ask("GET", "/api/v1/runs/3/certificate").parsed()["sha256"]);

  EXPECT_EQ(ask("POST", "/api/v1/runs", span(2, 50)).status, 422);
  EXPECT_EQ(ask("POST", "/api/v1/runs", span(5, 2)).status, 422);
  for (const json& wrong : {json{1}, json::object(), json{{"from_us", 1}}, json{{"from_us", 1}, {"to_us", "2"}},
                            json{{"boot_id", 77}, {"first_seq", 0}, {"last_seq", 1}},
                            json{{"from_us", 1}, {"to_us", 2}, {"last_seq", 1}}}) {
    by_time["span"] = wrong;
    EXPECT_EQ(ask("POST", "/api/v1/runs", by_time).status, 400) << wrong;
  }
}

TEST_F(RunRoutesTest, WhatIsSaidOfARunMayBeChanged) {
  record();
  const Answered changed =
      ask("POST", "/api/v1/runs/1/annotate", {{"notes", "warm"}, {"verdict", "good"}, {"mean_flow_m_s", 0.25}});
  ASSERT_EQ(changed.status, 200) << changed.body;
  EXPECT_EQ(changed.parsed()["notes"], "warm");
  EXPECT_EQ(changed.parsed()["mean_flow_m_s"], 0.25);
  EXPECT_EQ(changed.parsed()["name"], "first");
  EXPECT_EQ(ask("POST", "/api/v1/runs/1/annotate", {{"mean_flow_m_s", nullptr}}).parsed()["mean_flow_m_s"], nullptr);
  EXPECT_EQ(ask("POST", "/api/v1/runs/1/annotate", {{"name", ""}}).status, 422);
  EXPECT_EQ(ask("POST", "/api/v1/runs/1/annotate", {{"notes", 1}}).status, 400);
  EXPECT_EQ(ask("POST", "/api/v1/runs/1/annotate", {{"state", "open"}}).status, 400);
  EXPECT_EQ(ask("POST", "/api/v1/runs/99/annotate", {{"notes", ""}}).status, 404);
}

TEST_F(RunRoutesTest, ADiscardedRunIsListedOnlyByItsState) {
  record();
  EXPECT_EQ(ask("POST", "/api/v1/runs/1/discard", json::object()).status, 400);
  const Answered discarded = ask("POST", "/api/v1/runs/1/discard", {{"reason", "loose tube"}});
  ASSERT_EQ(discarded.status, 200) << discarded.body;
  EXPECT_EQ(discarded.parsed()["state"], "discarded");
  EXPECT_EQ(ask("GET", "/api/v1/runs").parsed()["runs"].size(), 0U);
  EXPECT_EQ(ask("GET", "/api/v1/runs?state=discarded").parsed()["runs"].size(), 1U);
  EXPECT_EQ(ask("GET", "/api/v1/runs?state=lost").status, 400);
  EXPECT_EQ(ask("POST", "/api/v1/runs/1/discard", {{"reason", "again"}}).status, 409);
}

// Of samples 0 to 19, 10 to 14 were made and never came.
TEST_F(RunRoutesTest, WhatIsMissingOfARunIsGivenUpOnAnAdminsWord) {
  connect_robot();
  ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "lost"}});
  make_samples(*robot, 0, 10);
  make_samples(*robot, 15, 5);
  ASSERT_EQ(ask("POST", "/api/v1/runs/1/end").status, 200);
  const char* path = "/api/v1/runs/1/finalize";
  EXPECT_EQ(ask("POST", path).status, 400);
  EXPECT_EQ(ask("POST", path, {{"samples_missing", -1}}).status, 422);
  EXPECT_EQ(ask("POST", "/api/v1/runs/9/finalize", {{"samples_missing", 5}}).status, 404);
  const Answered connected = ask("POST", path, {{"samples_missing", 5}});
  EXPECT_EQ(connected.status, 409);
  EXPECT_EQ(connected.parsed()["reason"], "robot_connected");
  robot->link.cut();
  ASSERT_TRUE(clock.run_until([&] { return station.find("r1")->link == station::LinkState::disconnected; }, 2s));
  const Answered another = ask("POST", path, {{"samples_missing", 4}});
  EXPECT_EQ(another.status, 409);
  EXPECT_EQ(another.parsed()["reason"], "missing_changed");
  EXPECT_EQ(ask("GET", "/api/v1/runs/1/certificate").parsed()["final"], false);
  const Answered given_up = ask("POST", path, {{"samples_missing", 5}});
  ASSERT_EQ(given_up.status, 200) << given_up.body;
  EXPECT_EQ(given_up.parsed()["samples_given_up"], 5);
  EXPECT_EQ(given_up.parsed()["final"], true);
  EXPECT_EQ(given_up.parsed()["lost_by_cause"], (json{{"given_up", 5}}));
  EXPECT_EQ(ask("GET", "/api/v1/audit?limit=1").parsed()["entries"][0]["action"], "run.finalized");
}

TEST_F(RunRoutesTest, MarkersAreListedByRobotAndByRun) {
  record();
  const Answered marked = ask("POST", "/api/v1/robots/r1/markers", {{"text", "glucose in"}});
  ASSERT_EQ(marked.status, 201) << marked.body;
  EXPECT_EQ(marked.parsed()["seq"], 9);
  EXPECT_EQ(marked.parsed()["boot_id"], "77");
  EXPECT_EQ(ask("GET", "/api/v1/runs/1/markers").parsed()["markers"], json::array({marked.parsed()}));
  EXPECT_EQ(ask("GET", "/api/v1/robots/r1/markers").parsed()["markers"], json::array({marked.parsed()}));
  EXPECT_EQ(ask("GET", "/api/v1/robots/r1/markers?after=1").parsed()["markers"], json::array());
  EXPECT_EQ(ask("POST", "/api/v1/robots/r1/markers", {{"text", ""}}).status, 422);
  EXPECT_EQ(ask("POST", "/api/v1/robots/r1/markers", {{"text", "x"}, {"at_us", 1}}).status, 422);
  EXPECT_EQ(ask("POST", "/api/v1/robots/r9/markers", {{"text", "x"}}).status, 404);
  EXPECT_EQ(ask("GET", "/api/v1/robots/r9/markers").status, 404);
  EXPECT_EQ(ask("GET", "/api/v1/runs/99/markers").status, 404);
}

// Before the robot's next sample, with which the run begins, has come; the robot may have made none so far.
TEST_F(RunRoutesTest, AMarkerRightAfterARunBeganIsInTheRun) {
  connect_robot();
  const auto marked_run = [this] {
    const json run = ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "marked"}}).parsed();
    const Answered marked = ask("POST", "/api/v1/robots/r1/markers", {{"text", "begins"}});
    EXPECT_EQ(marked.status, 201) << marked.body;
    EXPECT_EQ(marked.parsed()["seq"], run["spans"][0]["first_seq"]);
    const std::string path = fmt::format("/api/v1/runs/{}", run["run_id"].get<int>());
    const json listed = ask("GET", path + "/markers").parsed()["markers"];
    EXPECT_EQ(listed.size(), 1U) << path;
    return path;
  };
  const std::string first = marked_run();
  make_samples(*robot, 0, 10);
  EXPECT_EQ(ask("POST", "/api/v1/robots/r1/markers", {{"text", "later"}}).parsed()["seq"], 9);
  EXPECT_EQ(ask("POST", first + "/end").status, 200);
  EXPECT_EQ(ask("POST", "/api/v1/robots/r1/markers", {{"text", "no run is open"}}).parsed()["seq"], 9);
  const std::string second = marked_run();
  make_samples(*robot, 10, 10);
  EXPECT_EQ(ask("POST", second + "/end").status, 200);
  const json marker = ask("GET", second + "/markers").parsed()["markers"].at(0);
  const json sample = ask("GET", second + "/samples?limit=1").parsed()["samples"].at(0);
  EXPECT_EQ(marker["seq"], sample["seq"]);
  EXPECT_EQ(marker["robot_time_us"], sample["robot_time_us"]);
}

TEST_F(RunRoutesTest, TheSnapshotHoldsTheStationsConfiguration) {
  recording.runs.set_station_document("{\"limits\":{\"duty_max\":1.0}}");
  record();
  const Answered answered = ask("GET", "/api/v1/runs/1/snapshot");
  ASSERT_EQ(answered.status, 200) << answered.body;
  EXPECT_EQ(
      answered.parsed()["in_force"],
      (json::array(
          {{{"kind", "station"}, {"span", 0}, {"first_seq", 0}, {"content", {{"limits", {{"duty_max", 1.0}}}}}}})));
  EXPECT_EQ(ask("GET", "/api/v1/runs/99/snapshot").status, 404);
}

}  // namespace
}  // namespace server
