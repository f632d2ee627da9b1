// Faults from JSON, and what a time line makes of them.
#include "sim_robot/faults/fault.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "sim_robot/scenario/fault_timeline.hpp"
#include "sim_robot/world/microseconds.hpp"

namespace sim_robot {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

std::string error_of(const std::string& json) {
  try {
    parse_fault_json(json);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "no error";
}

TEST(FaultJson, TakesEachKindWithItsNumbers) {
  const Fault offset = parse_fault_json(R"({"fault":"electrode_offset","offset_mv":-40,"for_s":2.5})");
  EXPECT_EQ(offset.kind, FaultKind::electrode_offset);
  EXPECT_EQ(offset.magnitude, -40);
  EXPECT_EQ(offset.for_s, 2.5);
  EXPECT_EQ(parse_fault_json(R"({"fault":"accelerometer_stuck"})").for_s, kForEver);
  const Fault reboot = parse_fault_json(R"({"fault":"reboot","cause":"brown_out","keeps_latch":false})");
  EXPECT_EQ(reboot.cause, rheonaut_RESET_CAUSE_BROWN_OUT);
  EXPECT_FALSE(reboot.keeps_latch);
  const Fault loss = parse_fault_json(R"({"fault":"link_loss","loss_probability":0.5,"direction":"up"})");
  EXPECT_EQ(loss.direction, Direction::up);
  EXPECT_EQ(parse_fault_json(R"({"fault":"pour_glucose","position_m":0.2})").patch.position_m, 0.2);
}

TEST(FaultJson, SaysWhatIsWrongWhichValueAndWhatIsAllowed) {
  EXPECT_THAT(error_of("nonsense"), HasSubstr("not JSON"));
  EXPECT_THAT(error_of("[1]"), HasSubstr("a fault is an object"));
  EXPECT_THAT(error_of("{}"), StartsWith("fault: must be given"));
  EXPECT_THAT(error_of(R"({"fault":"electrode_ofset"})"), HasSubstr("did you mean 'electrode_offset'?"));
  EXPECT_EQ(error_of(R"({"fault":"electrode_offset","offset_mv":9000})"),
            "offset_mv: is 9000, allowed is -5000 to 5000");
  EXPECT_EQ(error_of(R"({"fault":"electrode_offset","offset_mv":"x"})"), "offset_mv: must be a number, is 'x'");
  EXPECT_THAT(error_of(R"({"fault":"electrode_stuck","offset_mv":1})"), StartsWith("offset_mv: is no key here"));
  EXPECT_EQ(error_of(R"({"fault":"electrode_stuck","fault":"block"})"), "fault: is given twice");
  EXPECT_THAT(error_of(R"({"fault":{"a":1}})"), HasSubstr("without objects in it"));
  EXPECT_THAT(error_of(R"({"fault":null})"), HasSubstr("is null"));
  EXPECT_THAT(error_of(R"({"fault":"electrode_stuck","for_s":1e999})"), HasSubstr("JSON"));
  EXPECT_THAT(error_of(std::string(10'000, '[')), HasSubstr("without objects in it"));
}

TEST(FaultTypes, ReadBackWhatTheTableSaysOfEachKind) {
  EXPECT_EQ(fault_types().size(), static_cast<std::size_t>(FaultKind::motor_supply_cut) + 1);
  EXPECT_STREQ(type_of(FaultKind::link_outage).name, "link_outage");
  EXPECT_STREQ(type_of(FaultKind::clock_jump).name, "clock_jump");
  EXPECT_STREQ(type_of(FaultKind::motor_supply_cut).name, "motor_supply_cut");
  EXPECT_STREQ(type_of(FaultKind::electrode_missing).name, "electrode_missing");
}

class Timeline : public ::testing::Test {
 protected:
  static SimulatedRobotConfig in_a_vessel() {
    SimulatedRobotConfig config;
    config.world.vessel.emplace().pump.ramp_s = 0.01;
    return config;
  }
  static Fault offset(double mv, double for_s = kForEver) {
    return {.kind = FaultKind::electrode_offset, .for_s = for_s, .magnitude = mv};
  }
  double reading_mv() {
    SimulatedRobot& robot = life_.robot();
    return static_cast<double>(robot.world().read(robot.robot_time_us()).impedance_mv);
  }
  // After the tick at this time.
  double reading_mv_at(FaultTimeline& faults, double time_s) {
    const std::uint64_t at_us = microseconds(time_s);
    for (; next_us_ <= at_us; next_us_ += SimulatedRobot::kPeriodUs) faults.advance(robot_, next_us_);
    return reading_mv();
  }

  RobotLife life_{in_a_vessel()};
  FaultyRobot robot_{life_, nullptr};
  std::uint64_t next_us_ = 0;
};

TEST_F(Timeline, BeginsAndEndsEachFaultAtItsTime) {
  FaultTimeline faults{{{1, offset(40, 2)}}};
  EXPECT_EQ(reading_mv_at(faults, 0.99), 175);
  EXPECT_EQ(reading_mv_at(faults, 1), 215);
  EXPECT_EQ(faults.in_force().size(), 1u);
  EXPECT_EQ(reading_mv_at(faults, 2.99), 215);
  EXPECT_EQ(reading_mv_at(faults, 3), 175);
  EXPECT_TRUE(faults.in_force().empty());
}

TEST_F(Timeline, AFaultReplacesTheOneOnTheSameTarget) {
  FaultTimeline faults{{{1, offset(40, 10)}, {2, offset(20, 1)}}};
  EXPECT_EQ(reading_mv_at(faults, 2), 195);
  EXPECT_EQ(faults.in_force().size(), 1u);
  EXPECT_EQ(reading_mv_at(faults, 3), 175);
}

TEST_F(Timeline, OneThatBeginsWhenTheOtherEndsIsInForce) {
  FaultTimeline faults{{{1, offset(40, 1)}, {2, offset(20)}}};
  EXPECT_EQ(reading_mv_at(faults, 2), 195);
}

TEST_F(Timeline, RealTimeAppliesAtTheSameTicks) {
  FaultTimeline faults{{{0.055, offset(40, 0.1)}}};
  faults.advance(robot_, 52'000);
  EXPECT_EQ(reading_mv(), 175);
  faults.advance(robot_, 59'000);
  EXPECT_EQ(reading_mv(), 215);
  EXPECT_EQ(faults.in_force().at(0).since_us, 55'000u);
  faults.advance(robot_, 10'000'000);  // after a stall, what was due meanwhile is over
  EXPECT_EQ(reading_mv(), 175);
  EXPECT_GT(life_.robot().robot_time_us(), 10'000'000u);
}

TEST_F(Timeline, TheFlowIsThatOfTheBeginningAfterwards) {
  FaultTimeline faults{{{1, {.kind = FaultKind::mean_flow, .for_s = 1, .mean_flow_m3_s = 0.001}}}};
  reading_mv_at(faults, 1.9);
  EXPECT_GT(life_.robot().world().flow_m3_s(), 0.0001);
  reading_mv_at(faults, 4);
  EXPECT_NEAR(life_.robot().world().flow_m3_s(), 0, 1e-9);
}

TEST_F(Timeline, ThePumpIsSetAsAnExperimentNamesIt) {
  FaultTimeline faults;
  const World& world = life_.robot().world();
  reading_mv_at(faults, 0.01);
  faults.inject(parse_fault_json(R"({"fault":"pump_flow","pump":"constant","mean_flow_m_s":0.05})"), robot_);
  reading_mv_at(faults, 3);
  EXPECT_NEAR(world.flow_velocity_m_s(), 0.05, 1e-6);
  const double before_m = world.position_m();
  reading_mv_at(faults, 4);
  EXPECT_NEAR(world.position_m() - before_m, 0.05, 1e-4) << "the robot is carried";
  faults.inject(parse_fault_json(R"({"fault":"pump_flow","pump":"pulse_70_bpm","mean_flow_m_s":0.05})"), robot_);
  reading_mv_at(faults, 6);
  const double first_m = world.position_m();
  reading_mv_at(faults, 12);  // 7 periods
  EXPECT_NEAR(world.position_m() - first_m, 0.3, 1e-3);
  EXPECT_EQ(faults.in_force().size(), 1u);
  faults.inject(parse_fault_json(R"({"fault":"pump_flow"})"), robot_);
  reading_mv_at(faults, 15);
  EXPECT_NEAR(world.flow_m3_s(), 0, 1e-9) << "off";
}

TEST_F(Timeline, RefusesAFlowThatThePumpCannotDrive) {
  const auto refused = [this](const char* json) {
    try {
      check(parse_fault_json(json), robot_);
    } catch (const std::invalid_argument& error) {
      return std::string(error.what());
    }
    return std::string("no error");
  };
  EXPECT_EQ(refused(R"({"fault":"pump_flow","mean_flow_m_s":0.1})"), "mean_flow_m_s is 0.1, but pump is off");
  EXPECT_THAT(refused(R"({"fault":"pump_flow","pump":"constant","mean_flow_m_s":1.1})"),
              HasSubstr("allowed is -1 to 1"));
  EXPECT_EQ(refused(R"({"fault":"pump_flow","pump":"constant","mean_flow_m_s":-1})"), "no error");
  WorldConfig wide;
  wide.vessel.emplace().large_diameter_m = 0.5;
  Fault fast = parse_fault_json(R"({"fault":"pump_flow","pump":"constant","mean_flow_m_s":1})");
  EXPECT_THROW(check(fast, wide), std::invalid_argument);
  wide.vessel.reset();
  EXPECT_THROW(check(fast, wide), std::invalid_argument);
}

TEST_F(Timeline, GlucoseIsPouredAndRemoved) {
  FaultTimeline faults{{{1, {.kind = FaultKind::pour_glucose, .for_s = 2, .patch = {.position_m = 0}}}}};
  EXPECT_EQ(reading_mv_at(faults, 1), 120);
  EXPECT_EQ(reading_mv_at(faults, 3), 175);
}

TEST_F(Timeline, InjectsAndWithdrawsWhileItRuns) {
  FaultTimeline faults;
  const std::uint64_t id = faults.inject(offset(40), robot_);
  EXPECT_EQ(reading_mv(), 215);
  EXPECT_FALSE(faults.withdraw(id + 1, robot_));
  EXPECT_TRUE(faults.withdraw(id, robot_));
  EXPECT_EQ(reading_mv(), 175);
  EXPECT_FALSE(faults.withdraw(id, robot_));
}

TEST_F(Timeline, PassesOverWhatThisRunCannotDoAndSaysSo) {
  std::vector<std::string> lines;
  FaultTimeline faults{{{1, {.kind = FaultKind::link_reset}}},
                       [&lines](const std::string& line) { lines.push_back(line); }};
  reading_mv_at(faults, 2);
  EXPECT_EQ(faults.passed_over(), 1u);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_THAT(lines[0], StartsWith("at 1 s: link_reset: not in this run"));
  EXPECT_THROW(faults.inject({.kind = FaultKind::link_outage}, robot_), std::invalid_argument);
  EXPECT_NO_THROW(faults.inject({.kind = FaultKind::reboot}, robot_)) << "which needs no network";
}

TEST_F(Timeline, RefusesWhatTheWorldLacks) {
  FaultTimeline faults;
  EXPECT_THROW(faults.inject({.kind = FaultKind::accelerometer_stuck}, robot_), std::invalid_argument);
}

TEST_F(Timeline, RefusesGlucoseWithoutEnd) {
  FaultTimeline faults;
  const Fault pour{.kind = FaultKind::pour_glucose, .patch = {.position_m = 5}};
  for (std::size_t i = 0; i < Glucose::kMaxPatches; ++i) faults.inject(pour, robot_);
  EXPECT_THROW(faults.inject(pour, robot_), std::invalid_argument);
}

}  // namespace
}  // namespace sim_robot
