// Tools that read a recorded run: while the station records, with gaps and reboots, and without changing a byte.
#include <gmock/gmock.h>

#include <cmath>
#include <regex>
#include <set>
#include <string>
#include <utility>

#include "tests/server/cli/run_tools_fixture.hpp"

namespace server {
namespace {

using cli::ToolAnswer;
using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;

TEST_F(RunTools, ReadsTheSamplesWhileTheStationRecords) {
  const storage::RunId run = begin();
  swim(100, 0.3);
  flush();
  const auto samples = storage::read_run(path_, run, 1000);
  ASSERT_TRUE(samples) << samples.error().detail;
  EXPECT_EQ(samples->size(), 100u);
  EXPECT_EQ(samples->front().boot_id, robot_.boot_id);
  EXPECT_EQ(samples->back().sample.duty, 0.3F);
  EXPECT_FALSE(storage::read_run(path_, run, 99));
  EXPECT_THAT(storage::read_run(path_, run + 1, 99).error().detail, HasSubstr("the database holds runs 1 to 1"));
}

TEST_F(RunTools, RefusesAFileThatIsNotAStations) {
  std::ofstream{folder_ / "station.sqlite"} << "not a database, but long enough to be looked at as one";
  EXPECT_THAT(ask("identify --run 1").error, HasSubstr("station.sqlite"));
}

TEST_F(RunTools, IdentifyFindsTheModelWithoutTheDisturbance) {
  begin();
  swim(200, 0.3);
  robot_.context.disturbance_m = -0.05F;
  swim(200, -0.5);
  flush();
  const ToolAnswer answer = ask("identify --run 1 --structure fractional --json");
  ASSERT_EQ(answer.exit_code, 0) << answer.error;
  EXPECT_NEAR(answer.json()["parameters"]["kp"], 0.1, 1e-3);
}

TEST_F(RunTools, IdentifyFitsTheAccelerationWhereThePositionIsAnEstimate) {
  const storage::RunId run = begin();
  robot_.context.position_sd_m = 0.004F;
  for (const double duty : {0.0, 0.4, -0.5, 0.6, -0.6, 0.3}) swim_on_the_accelerometer(100, duty);
  flush();
  const auto [of_run, of_csv] = from_run_and_csv(run);
  EXPECT_EQ(of_run, of_csv);
  EXPECT_EQ(of_run["channels"], nlohmann::json{"acceleration_m_s2"});
  EXPECT_THAT(of_run["channels_reason"].get<std::string>(), AllOf(HasSubstr("estimates"), HasSubstr("0.004 m")));
  EXPECT_TRUE(of_run["sensor"]["readings_are_recovered"].get<bool>());
  EXPECT_NEAR(of_run["parameters"]["kp"].get<double>(), 0.1, 0.01);  // half of it by the position
  EXPECT_THAT(of_run["warnings"].dump(), Not(HasSubstr("in motion")));
  const ToolAnswer text = ask("identify --run 1 --structure second_order");
  EXPECT_THAT(text.text, AllOf(HasSubstr("fitted: acceleration_m_s2; position_m and velocity_m_s are the robot's own"),
                               HasSubstr("sensor: ")));
}

TEST_F(RunTools, AnUncertaintyThatIsNotKnownIsNotCertainty) {
  const storage::RunId run = begin();
  robot_.context.position_sd_m = std::nullopt;
  for (const double duty : {0.0, 0.4, -0.5, 0.6, -0.6, 0.3}) swim_on_the_accelerometer(100, duty);
  flush();
  const auto [of_run, of_csv] = from_run_and_csv(run);
  EXPECT_EQ(of_run, of_csv);
  EXPECT_EQ(of_run["channels"], nlohmann::json{"acceleration_m_s2"});
  EXPECT_THAT(of_run["channels_reason"].get<std::string>(), HasSubstr("estimates (position_sd_m is not known)"));
}

TEST_F(RunTools, ACsvWhosePositionIsNotKnownToBeKnownNeedsTheAcceleration) {
  std::ofstream{folder_ / "run.csv"} << "t_s,duty,position_m,position_sd_m\n0,0,0,0\n0.01,0.3,0,\n0.02,0.3,0,0\n";
  EXPECT_THAT(cli::ask_tool(folder_, "identify --csv @run.csv").error,
              AllOf(HasSubstr("position_sd_m is not known"), HasSubstr("there is no column acceleration_m_s2")));
}

TEST_F(RunTools, ADisturbanceIsTakenOffAMeasuredPositionToo) {
  const storage::RunId run = begin();
  swim(200, 0.3);
  robot_.context.disturbance_m = -0.05F;
  swim(200, -0.5);
  flush();
  write_csv(run, false);
  const ToolAnswer answer = cli::ask_tool(folder_, "identify --csv @run.csv --structure fractional --json");
  ASSERT_EQ(answer.exit_code, 0) << answer.error;
  EXPECT_NEAR(answer.json()["parameters"]["kp"], 0.1, 1e-3);
  EXPECT_THAT(answer.json()["channels_reason"].get<std::string>(), HasSubstr("less disturbance_m"));
}

TEST_F(RunTools, IdentifySaysHowMuchDeadTimeTheSensorsReadingsMayHide) {
  control::FractionalModel late = control::kNonNewtonianModel;
  late.dead_time_s = 0.03;
  plant_ = control::ModalPlant{late, 0.01};
  begin();
  robot_.context.position_sd_m = 0.004F;
  for (const double duty : {0.0, 0.4, -0.5, 0.6, -0.6, 0.3}) swim_on_the_accelerometer(100, duty);
  flush();
  const std::string ask_it = "identify --run 1 --structure second_order ";
  const std::string doubt = "ms cannot be told from the age of the sensor's readings";
  EXPECT_THAT(ask(ask_it).text, HasSubstr(doubt));
  EXPECT_THAT(ask(ask_it + "--json").json()["warnings"].dump(), HasSubstr(doubt));
  EXPECT_THAT(ask(ask_it + "--sensor-lag-s 0.03").text, Not(HasSubstr(doubt)));
}

// The two are not to be added: of samples in step with the ticks half a period is their age, the rest is the dead time.
TEST_F(RunTools, IdentifySaysThatTheDelayOfTheReadingsHoldsTheDeadTime) {
  control::FractionalModel late = control::kNonNewtonianModel;
  late.dead_time_s = 0.06;
  plant_ = control::ModalPlant{late, 0.01};
  begin();
  robot_.context.position_sd_m = 0.004F;
  for (const double duty : {0.0, 0.4, -0.5, 0.6, -0.6, 0.3}) swim_on_the_accelerometer(100, duty);
  flush();
  const std::string ask_it = "identify --run 1 --structure fractional ";
  const std::string text = ask(ask_it).text;
  const std::regex sentence{
      "readings ([0-9.]+) ms late in the mean, the dead time of ([0-9.]+) ms included, and by a "};
  std::smatch found;
  ASSERT_TRUE(std::regex_search(text, found, sentence)) << text;
  const double late_ms = std::stod(found[1]), dead_time_ms = std::stod(found[2]);
  EXPECT_NEAR(dead_time_ms, 60, 6);
  EXPECT_NEAR(late_ms - dead_time_ms, 5, 0.011);
  EXPECT_THAT(ask(ask_it + "--dead-time-s 0").text, AllOf(HasSubstr(" ms late in the mean and by a low pass"),
                                                          Not(HasSubstr("included")), HasSubstr("dead time 0 s")));
}

TEST_F(RunTools, IdentifyFitsAKnownPositionAloneFromRunAndCsvAlike) {
  const storage::RunId run = begin();
  swim(200, 0.3);
  robot_.context.disturbance_m = -0.05F;
  swim(200, -0.5);
  flush();
  const auto [of_run, of_csv] = from_run_and_csv(run);
  EXPECT_EQ(of_run, of_csv);
  EXPECT_EQ(of_run["channels"], nlohmann::json{"position_m"});
}

TEST_F(RunTools, IdentifyNeedsOnlyTheValuesThatItFitsFromRunAndCsvAlike) {
  const storage::RunId run = begin();
  lacks_a_velocity_ = true;
  for (const double duty : {0.3, -0.5}) swim(150, duty);
  flush();
  const auto [of_run, of_csv] = from_run_and_csv(run);
  EXPECT_EQ(of_run, of_csv);
  EXPECT_EQ(of_run["channels"], nlohmann::json{"position_m"});
  EXPECT_THAT(cli::ask_tool(folder_, "identify --csv @run.csv --with-velocity").error,
              HasSubstr("value 1 of column velocity_m_s is empty"));
}

TEST_F(RunTools, IdentifyNeedsNoEstimateWhereItFitsTheAcceleration) {
  const storage::RunId run = begin();
  robot_.context.position_sd_m = 0.004F;
  lacks_a_velocity_ = true;
  for (const double duty : {0.4, -0.5, 0.6}) swim_on_the_accelerometer(100, duty);
  flush();
  const auto [of_run, of_csv] = from_run_and_csv(run);
  EXPECT_EQ(of_run, of_csv);
  EXPECT_EQ(of_run["channels"], nlohmann::json{"acceleration_m_s2"});
}

TEST_F(RunTools, IdentifyRefusesAGapAndSaysWhereItIs) {
  begin();
  swim(100, 0.3);
  robot_.next_seq += 20;
  robot_.oldest_seq = robot_.next_seq;
  swim(100, 0.3);
  flush();
  const ToolAnswer answer = ask("identify --run 1");
  EXPECT_EQ(answer.exit_code, 1);
  EXPECT_THAT(answer.error, AllOf(HasSubstr("run 1: "),
                                  HasSubstr("a gap of 0.210 s at 0.990 s (20 samples after seq 99 are not there)"),
                                  HasSubstr("--from-s 0 --to-s 0.99, or --from-s 1.2 --to-s 2.19")));
  EXPECT_THAT(ask("identify --run 1 --from-s 5").error, HasSubstr("has 0 samples"));
  EXPECT_NE(ask("identify --run 1 --to-s 0.99 --structure first_order").exit_code, 1);
}

TEST_F(RunTools, IdentifyTakesPeriodsThatTheRobotSkippedAsTicksWithoutAValue) {
  begin();
  swim(100, 0.3);
  robot_.late_us = 50'000;
  swim(300, 0.3);
  flush();
  const ToolAnswer answer = ask("identify --run 1 --structure first_order");
  EXPECT_NE(answer.exit_code, 1) << answer.error;
  EXPECT_THAT(answer.error, HasSubstr("5 of 405 ticks are missing, the first at 1 s"));
}

TEST_F(RunTools, IdentifyDistinguishesARobotThatRanLateFromLostSamples) {
  begin();
  swim(100, 0.3);
  robot_.late_us = 300'000;
  swim(50, 0.3);
  robot_.late_us = 320'000;
  swim(200, 0.3);
  flush();
  const ToolAnswer answer = ask("identify --run 1");
  EXPECT_EQ(answer.exit_code, 1);
  EXPECT_THAT(answer.error, AllOf(HasSubstr("the robot skipped 30 periods at 0.990 s; no sample was lost"),
                                  HasSubstr("choose --from-s 1.3 --to-s 3.81, or --from-s 0 --to-s 0.99"),
                                  Not(HasSubstr("not there"))));
  EXPECT_NE(ask("identify --run 1 --from-s 1.3 --to-s 3.81 --structure first_order").exit_code, 1);
}

// Of each 20 periods one more is skipped at first, 4.8 %, and two in the last third: 6.1 % in all.
TEST_F(RunTools, MoreSkippedPeriodsThanTolerableCostTheEndOfTheRunOnly) {
  begin();
  for (int part = 0; part < 60; ++part) {
    swim(20, part % 2 == 0 ? 0.3 : -0.2);
    robot_.late_us += part < 40 ? 10'000 : 20'000;
  }
  flush();
  const ToolAnswer refused = ask("identify --run 1 --structure first_order");
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.error, HasSubstr("the robot skipped "));
  EXPECT_THAT(refused.error, HasSubstr(" periods, more than 5 %; choose --from-s 0 --to-s "));
  const ToolAnswer answer = ask("identify --run 1 --structure first_order --cut-at-gaps");
  EXPECT_NE(answer.exit_code, 1) << answer.error;
  EXPECT_THAT(answer.error, HasSubstr("fitted is the longest part with fewer that begins at rest, from 0.000 to "));
}

// The longer part begins under way, where the model is not at rest.
TEST_F(RunTools, CutAtGapsTakesTheLongestPartThatBeginsAtRest) {
  begin();
  swim(300, 0.3);
  robot_.late_us = 600'000;
  swim(200, 0.3);
  flush();
  const ToolAnswer answer = ask("identify --run 1 --cut-at-gaps --structure first_order");
  EXPECT_NE(answer.exit_code, 1) << answer.error;
  EXPECT_THAT(answer.error, HasSubstr("its longest part without one that begins at rest, from 0.000 to 2.990 s"));
}

TEST_F(RunTools, CutAtGapsFitsNoSmallPartOfARun) {
  begin();
  swim(100, 0.3);
  robot_.late_us = 600'000;
  swim(200, 0.3);
  flush();
  const ToolAnswer answer = ask("identify --run 1 --cut-at-gaps --structure first_order");
  EXPECT_EQ(answer.exit_code, 1);
  EXPECT_THAT(answer.error, HasSubstr("of the 3.6 s that were asked for only 1.0 s can be fitted, less than 50 %"));
  EXPECT_NE(ask("identify --run 1 --to-s 0.99 --structure first_order").exit_code, 1) << "a part that somebody names";
}

TEST_F(RunTools, CutAtGapsTakesALaterPartAfterARest) {
  begin();
  swim(50, 0.3);
  swim(550, 0);
  robot_.late_us = 600'000;
  swim(700, -0.3);
  flush();
  const ToolAnswer answer = ask("identify --run 1 --cut-at-gaps --structure first_order");
  EXPECT_NE(answer.exit_code, 1) << answer.error;
  EXPECT_THAT(answer.error, HasSubstr("from 6.600 to"));
}

TEST_F(RunTools, IdentifyWarnsOfAWindowThatBeginsInMotion) {
  begin();
  swim(100, 0);
  swim(200, 0.3);
  swim(600, 0);
  swim(200, -0.3);
  flush();
  const ToolAnswer moving = ask("identify --run 1 --from-s 1.5 --structure first_order --json");
  EXPECT_THAT(moving.error, AllOf(HasSubstr("rheonaut: warning: the window begins at 1.500 s"), HasSubstr("at rest")));
  EXPECT_THAT(moving.json()["warnings"].back().get<std::string>(), HasSubstr("assumes rest"));
  EXPECT_EQ(ask("identify --run 1 --from-s 8.5 --structure first_order").error, "");
  EXPECT_EQ(ask("identify --run 1 --structure first_order").error, "");
}

TEST_F(RunTools, IdentifyWarnsOfAnEstimatedRunThatBeginsInMotion) {
  for (int tick = 0; tick < 200; ++tick) plant_.step(0.4);
  const storage::RunId run = begin();
  robot_.context.position_sd_m = 0.004F;
  for (const double duty : {0.4, -0.5, 0.6}) swim_on_the_accelerometer(100, duty);
  flush();
  const auto [of_run, of_csv] = from_run_and_csv(run);
  EXPECT_THAT(of_run["warnings"].back().get<std::string>(), HasSubstr("begins in motion, at about 0.0"));
  EXPECT_EQ(of_run["warnings"], of_csv["warnings"]);
}

TEST_F(RunTools, IdentifyOfSeveralRunsEndsWithStatus4IfItExplainsNoneOfThem) {
  const storage::RunId first = begin();
  tremble(400);
  flush();
  ASSERT_TRUE(wait(runs_->end(first, "")));
  const storage::RunId second = wait(runs_->create(robot_.id, named("again"))).value().id;
  tremble(400);
  flush();
  ASSERT_TRUE(wait(runs_->end(second, "")));
  ASSERT_TRUE(wait(runs_->create(robot_.id, named("moves"))));
  swim(200, 0.3);
  swim(200, -0.3);
  flush();
  const ToolAnswer none = ask("identify --run 1 --run 2 --structure first_order");
  EXPECT_EQ(none.exit_code, 4);
  EXPECT_THAT(none.error, ContainsRegex("explains .* % of run 1 and .* % of run 2, so its parameters say nothing"));
  const ToolAnswer one = ask("identify --run 1 --run 3 --structure first_order");
  EXPECT_EQ(one.exit_code, 0) << one.error;
  EXPECT_THAT(one.error, ContainsRegex("explains .* % of run 1 only; its parameters come from the other runs"));
}

TEST_F(RunTools, ReadingADatabaseAtRestLeavesNothingBeside) {
  const storage::RunId run = begin();
  swim(100, 0.3);
  flush();
  stop();
  const auto listing = [this] {
    std::set<std::filesystem::path> files;
    for (const auto& entry : std::filesystem::directory_iterator{folder_}) files.insert(entry.path().filename());
    return files;
  };
  const auto before = listing();
  EXPECT_FALSE(before.contains("station.sqlite-wal"));
  std::filesystem::permissions(folder_, std::filesystem::perms{0500});
  const auto samples = storage::read_run(path_, run, 1000);
  std::filesystem::permissions(folder_, std::filesystem::perms{0700});
  ASSERT_TRUE(samples) << samples.error().detail;
  EXPECT_EQ(samples->size(), 100u);
  EXPECT_EQ(listing(), before);
}

}  // namespace
}  // namespace server
