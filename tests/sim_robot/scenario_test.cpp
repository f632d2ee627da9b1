// Scenario files: what they set, and errors that name file, line, column, key, value and what is allowed.
#include "sim_robot/scenario/scenario.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "sim_robot/scenario/scenario_tables.hpp"

namespace sim_robot {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

std::string error_of(const std::string& text) {
  try {
    parse_scenario(text, "mine.toml");
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "no error";
}

TEST(Scenario, SetsWhatTheFileSaysAndLeavesTheRest) {
  const Scenario scenario = parse_scenario(R"(
description = "mine"
duration_s = 30
seed = 7
[robot]
id = "sim-9"
duty_min = 0
[fluid]
preset = "water"
[vessel]
junction_m = 0.5
[vessel.pump]
mean_flow_m3_s = 0.0004
kind = "constant"
[[glucose.patches]]
position_m = 0.2
[battery]
preset = "cr123a"
sag_mv = 100
)",
                                           "folder/mine.toml");
  EXPECT_EQ(scenario.name, "mine");
  EXPECT_EQ(scenario.description, "mine");
  EXPECT_EQ(scenario.duration_s, 30);
  EXPECT_EQ(scenario.robot.robot_id, "sim-9");
  EXPECT_EQ(scenario.robot.duty.min, 0);
  EXPECT_EQ(scenario.robot.duty.max, 1);
  const WorldConfig& world = scenario.robot.world;
  EXPECT_EQ(world.seed, 7u);
  EXPECT_EQ(world.plant.model.alpha, 2);
  EXPECT_EQ(world.vessel.value().junction_m, 0.5);
  EXPECT_EQ(world.vessel.value().pump.mean_flow_m3_s, 0.0004);
  EXPECT_EQ(world.vessel.value().pump.kind, PumpKind::constant);
  EXPECT_EQ(world.glucose.patches.at(0).position_m, 0.2);
  EXPECT_EQ(world.battery.sag_mv, 100);
  EXPECT_EQ(world.battery.idle_discharge_mv_h, kCr123a.idle_discharge_mv_h);
  EXPECT_TRUE(world.imu.has_value());
}

TEST(Scenario, AnEmptyFileIsARobotInTheFabricSoftenerForEver) {
  const Scenario scenario = parse_scenario("", "empty.toml");
  EXPECT_EQ(scenario.duration_s, 0);
  EXPECT_FALSE(scenario.robot.world.vessel.has_value());
  EXPECT_TRUE(scenario.faults.empty());
}

TEST(Scenario, PutsFaultsAndScriptInTheOrderOfTheirTimes) {
  const Scenario scenario = parse_scenario(R"(
[[faults]]
at_s = 5
fault = "electrode_offset"
offset_mv = 40
[[faults]]
at_s = 2
fault = "accelerometer_stuck"
for_s = 1.5
[[script]]
at_s = 3
command = "set_manual"
[[script]]
at_s = 1
command = "set_auto"
setpoint_m = 0.1
)",
                                           "x.toml");
  ASSERT_EQ(scenario.faults.size(), 2u);
  EXPECT_EQ(scenario.faults[0].fault.kind, FaultKind::accelerometer_stuck);
  EXPECT_EQ(scenario.faults[0].fault.for_s, 1.5);
  EXPECT_EQ(scenario.faults[1].fault.magnitude, 40);
  EXPECT_EQ(scenario.faults[1].fault.for_s, kForEver);
  ASSERT_EQ(scenario.script.size(), 2u);
  EXPECT_EQ(scenario.script[0].command, ScriptCommand::set_auto);
}

TEST(Scenario, AnErrorNamesFileLineColumnKeyValueAndWhatIsAllowed) {
  EXPECT_EQ(error_of("duration_s = 5\nseed = -3\n"), "mine.toml:2:8: seed: is -3, allowed is 0 to 9e+18");
  EXPECT_EQ(error_of("[vessel]\n\njunction_m = \"x\"\n"),
            "mine.toml:3:14: vessel.junction_m: must be a number, is 'x'");
  EXPECT_EQ(error_of("[robot]\nduty_max = 2\n"), "mine.toml:2:12: robot.duty_max: is 2, allowed is 0 to 1");
}

TEST(Scenario, RefusesUnknownKeysAndNamesTheNearest) {
  EXPECT_THAT(error_of("a = 1\n"), StartsWith("mine.toml:1:1: a: is no key here; there are description,"));
  EXPECT_THAT(error_of("[vesel]\na = 1\n"), HasSubstr("vesel: is no key here; did you mean 'vessel'?"));
  EXPECT_THAT(error_of("[vessel.pump]\nmean_flow = 1\n"),
              StartsWith("mine.toml:2:1: vessel.pump.mean_flow: is no key here; did you mean 'mean_flow_m3_s'?"));
  EXPECT_THAT(error_of("[accelerometer]\npreset = \"perfect\"\nbandwidth_hz = 5\n"), StartsWith("mine.toml:3:1: "));
}

TEST(Scenario, RefusesWrongTypesDuplicatesAndBrokenToml) {
  EXPECT_THAT(error_of("vessel = 3\n"), StartsWith("mine.toml:1:10: vessel: must be a table, is 3"));
  EXPECT_THAT(error_of("[faults]\nat_s = 3\n"), HasSubstr("faults: must be a list of tables, [[faults]]"));
  EXPECT_THAT(error_of("faults = [1]\n"), StartsWith("mine.toml:1:11: faults[0]: must be a table, is 1"));
  EXPECT_THAT(error_of("seed = 1.5\n"), HasSubstr("seed: must be a whole number, is 1.5"));
  EXPECT_THAT(error_of("seed = 1\nseed = 2\n"), StartsWith("mine.toml:2:"));
  EXPECT_THAT(error_of("seed = \n"), StartsWith("mine.toml:1:"));
  EXPECT_THAT(error_of("duration_s = nan\n"), HasSubstr("duration_s: is nan, allowed is 0 to"));
  EXPECT_THAT(error_of("description = \"" + std::string(2'000'000, 'x') + "\"\n"), HasSubstr("bytes, allowed are"));
}

TEST(Scenario, SaysAtWhichTableOrKeyTheWorldCannotBe) {
  EXPECT_THAT(error_of("\n[motor]\ndead_zone_duty = 1\n"),
              StartsWith("mine.toml:3:18: motor.dead_zone_duty: motor: dead_zone_duty must be in [0, 1), is 1"));
  EXPECT_THAT(error_of("\n[fluid]\nalpha = 0.5\n"), StartsWith("mine.toml:3:9: fluid.alpha: "));
  EXPECT_THAT(error_of("[robot]\nid = \"A B\"\n"), StartsWith("mine.toml:2:6: robot.id: robot id 'A B' is not"));
}

TEST(Scenario, AFaultNeedsItsNumbersAndAWorldThatCanHaveIt) {
  EXPECT_THAT(
      error_of("[[faults]]\nat_s = 1\nfault = \"electrod_stuck\"\n"),
      StartsWith("mine.toml:3:9: faults[0].fault: there is no 'electrod_stuck'; did you mean 'electrode_stuck'?"));
  EXPECT_THAT(error_of("[[faults]]\nat_s = 1\nfault = \"electrode_offset\"\n"),
              StartsWith("mine.toml:1:1: faults[0].offset_mv: must be given: what is added"));
  EXPECT_THAT(error_of("[[faults]]\nat_s = 1\nfault = \"electrode_offset\"\nofset_mv = 3\n"),
              HasSubstr("is 'ofset_mv' in line 4 meant for it?"));
  EXPECT_THAT(error_of("[[faults]]\nfault = \"electrode_stuck\"\n"), HasSubstr("faults[0].at_s: must be given"));
  EXPECT_THAT(error_of("[[faults]]\nat_s = 1\nfault = \"mean_flow\"\nmean_flow_m3_s = 0.001\n"),
              HasSubstr("there is no vessel"));
  EXPECT_THAT(error_of("accelerometer.preset = \"perfect\"\n[[faults]]\nat_s = 1\nfault = \"accelerometer_stuck\"\n"),
              HasSubstr("the perfect sensor has no faults"));
  EXPECT_THAT(error_of("duration_s = 5\n[[faults]]\nat_s = 6\nfault = \"electrode_stuck\"\n"),
              StartsWith("mine.toml:3:8: faults[0].at_s: at_s is 6, when the scenario has ended"));
}

TEST(Scenario, AFileThatIsNotThereIsAnErrorThatNamesIt) {
  EXPECT_THROW(load_scenario("/nowhere/x.toml"), std::invalid_argument);
  EXPECT_THROW(load_scenario("/"), std::invalid_argument);
  try {
    find_scenario("figure_77");
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr("figure_7, figure_8_non_newtonian"));
  }
}

TEST(Scenario, TheDocumentHoldsTheParsersOwnTables) {
  std::ifstream file{std::string(TEST_DATA_DIR) + "/../../docs/scenarios.md"};
  std::ostringstream document;
  document << file.rdbuf();
  std::istringstream tables{scenario_tables()};
  for (std::string line; std::getline(tables, line);) {
    EXPECT_THAT(document.str(), HasSubstr(line + "\n")) << "from rheonaut-sim scenarios --keys";
  }
}

}  // namespace
}  // namespace sim_robot
