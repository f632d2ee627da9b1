// The shipped scenarios do what their figures say, and the same scenario gives the same bytes.
#include "sim_robot/scenario_run.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "control/step_metrics.hpp"

namespace sim_robot {
namespace {

constexpr double kBandM = 0.002;

Scenario shipped(const std::string& name, std::uint64_t boot_id = 0x51) {
  Scenario scenario = find_scenario(name);
  scenario.robot.boot_id = boot_id;
  return scenario;
}

struct Record {
  explicit Record(const Scenario& scenario) : run(scenario) {
    run.run();
    for (const auto& [seq, sample] : run.station().samples) {
      time_s.push_back(static_cast<double>(sample.robot_time_us) * 1e-6);
      position_m.push_back(static_cast<double>(sample.position_m));
      duty.push_back(static_cast<double>(sample.duty));
      impedance_mv.push_back(static_cast<double>(sample.impedance_mv));
    }
  }
  control::StepMetrics step(double end_s) const {
    return control::measure_step(time_s, position_m, {0, end_s, 0, 0.1, kBandM});
  }
  control::StepMetrics disturbance() const {
    return control::measure_step(time_s, position_m, {20, time_s.back(), 0.05, 0.1, kBandM});
  }

  ScenarioRun run;
  std::vector<double> time_s, position_m, duty, impedance_mv;
};

TEST(ShippedScenarios, AreAllThere) {
  std::vector<std::string> names;
  for (const ShippedScenario& each : shipped_scenarios()) names.emplace_back(each.name);
  const std::vector<std::string> expected{"bad_day",        "figure_5", "figure_7", "figure_8_non_newtonian",
                                          "figure_8_water", "figure_9", "figure_a2"};
  EXPECT_EQ(names, expected);
}

TEST(ShippedScenarios, HaveADescriptionAnEndAndNoSampleLost) {
  for (const ShippedScenario& each : shipped_scenarios()) {
    const Scenario scenario = shipped(std::string(each.name));
    EXPECT_NE(scenario.description, Scenario{}.description) << each.name;
    EXPECT_GT(scenario.duration_s, 0) << each.name;
    const Record record{scenario};
    EXPECT_NEAR(record.time_s.back(), scenario.duration_s, 0.011) << each.name;
    EXPECT_EQ(record.time_s.size(), static_cast<std::size_t>(std::lround(scenario.duration_s * 100))) << each.name;
    for (const auto& ack : record.run.station().acks) {
      EXPECT_EQ(ack.reason, rheonaut_REJECT_REASON_NONE) << each.name << " " << ack.command_id;
    }
  }
}

TEST(ShippedScenarios, Figure5GoesAsFarAsTheModelAndNeverOvershootsItsVelocity) {
  const Record record{shipped("figure_5")};
  EXPECT_NEAR(record.run.robot().world().position_m(), 0.1497, 0.0015);  // with what it coasts after the 5 s
  double truth_at_6_s = 0, fastest_m_s = 0;
  ScenarioRun again{shipped("figure_5")};
  while (again.time_s() < 6) {
    again.step();
    fastest_m_s = std::max(fastest_m_s, again.robot().world().velocity_m_s());
    truth_at_6_s = again.robot().world().position_m();
  }
  EXPECT_NEAR(truth_at_6_s, 0.145660768388, 0.0004);  // the duty begins within a tick of 1 s
  EXPECT_LT(fastest_m_s, 0.03);
  EXPECT_GT(fastest_m_s, 0.0298);
}

TEST(ShippedScenarios, Figures7And8SettleInTheFabricSoftener) {
  const Record figure_7{shipped("figure_7")}, figure_8{shipped("figure_8_non_newtonian")};
  for (const Record* record : {&figure_7, &figure_8}) {
    EXPECT_NEAR(record->step(19.9).settling_s.value(), 1.15, 0.02);
    EXPECT_NEAR(record->step(19.9).overshoot_percent, 0.45, 0.05);
  }
  EXPECT_NEAR(figure_7.disturbance().settling_s.value(), 0.63, 0.03);
  EXPECT_NEAR(figure_7.disturbance().overshoot_percent, 1.43, 0.15);
}

TEST(ShippedScenarios, Figures8And9SettleInWaterWithOvershoot) {
  const Record figure_8{shipped("figure_8_water")}, figure_9{shipped("figure_9")};
  for (const Record* record : {&figure_8, &figure_9}) {
    EXPECT_NEAR(record->step(19.9).settling_s.value(), 0.84, 0.02);
    EXPECT_NEAR(record->step(19.9).overshoot_percent, 9.82, 0.2);
  }
  EXPECT_NEAR(figure_9.disturbance().settling_s.value(), 0.70, 0.03);
  EXPECT_NEAR(figure_9.disturbance().overshoot_percent, 20.1, 0.5);
}

TEST(ShippedScenarios, FigureA2ShowsTheDip) {
  ScenarioRun run{shipped("figure_a2")};
  bool dipped = false;
  while (run.time_s() < 10.99) {
    run.step();
    const double x = run.robot().world().position_m();
    const double mv = static_cast<double>(run.station().samples.rbegin()->second.impedance_mv);
    if (x < 0.18 || x > 0.33) EXPECT_NEAR(mv, 177, 8) << x;  // DS550: 2 mV too high, noise of 1 mV
    if (x > 0.22 && x < 0.28) EXPECT_NEAR(mv, 122, 8) << x;
    dipped = dipped || mv < 125;
  }
  EXPECT_TRUE(dipped);
  EXPECT_GT(run.robot().world().position_m(), 0.33);
}

TEST(ShippedScenarios, ABadDayStaysWithinTheRulesAndSaysWhatIsWrong) {
  const Scenario scenario = shipped("bad_day");
  const Record record{scenario};
  for (const double duty : record.duty) ASSERT_LE(std::abs(duty), 1);
  std::uint64_t last_us = 0;
  for (const auto& [seq, sample] : record.run.station().samples) {
    ASSERT_TRUE(last_us == 0 || sample.robot_time_us == last_us + SimulatedRobot::kPeriodUs) << seq;
    last_us = sample.robot_time_us;
    if (sample.mode == rheonaut_MODE_EMERGENCY) ASSERT_EQ(sample.duty, 0) << seq;
  }
  int latched = 0;
  for (const protocol::Event& event : record.run.station().events) {
    latched += event.kind == rheonaut_EVENT_KIND_EMERGENCY ? 1 : 0;
  }
  EXPECT_GE(latched, 3);  // both sensors, and the stop at the end
  EXPECT_LT(record.run.robot().world().supply_mv(), 3000);
}

TEST(ShippedScenarios, TheMotorIsOffThroughTheOutagesOfABadDay) {
  ScenarioRun run{shipped("bad_day")};
  while (run.time_s() < 119.9) {
    const bool was_out = run.link_is_out();
    const double time_s = run.time_s();
    run.step();
    if (was_out && ((time_s > 16.1 && time_s < 18) || time_s > 56.1)) ASSERT_EQ(run.robot().core().duty(), 0) << time_s;
  }
}

// Determinism.

std::vector<std::uint8_t> bytes_of(const Scenario& scenario) {
  ScenarioRun run{scenario};
  run.run();
  return run.bytes();
}

TEST(ScenarioRun, TheSameScenarioAndBootIdGiveTheSameBytes) {
  for (const char* name : {"figure_5", "figure_a2", "bad_day"}) {
    const auto bytes = bytes_of(shipped(name));
    EXPECT_GT(bytes.size(), 10'000u);
    EXPECT_TRUE(bytes == bytes_of(shipped(name))) << name;
  }
}

TEST(ScenarioRun, AnotherBootIdChangesTheIdsAlone) {
  const auto bytes = bytes_of(shipped("figure_a2")), others = bytes_of(shipped("figure_a2", 0xAE));
  ASSERT_EQ(bytes.size(), others.size());
  std::size_t different = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) different += bytes[i] != others[i] ? 1 : 0;
  EXPECT_EQ(different, 1u);  // 0x51 and 0xAE in the one Hello
}

TEST(ScenarioRun, AnotherSeedGivesOtherBytes) {
  Scenario other = shipped("figure_5");
  other.robot.world.seed += 1;
  EXPECT_FALSE(bytes_of(other) == bytes_of(shipped("figure_5")));
}

TEST(ScenarioRun, NeedsAnEnd) {
  Scenario scenario = shipped("figure_5");
  scenario.duration_s = 0;
  ScenarioRun run{scenario};
  EXPECT_THROW(run.run(), std::invalid_argument);
}

}  // namespace
}  // namespace sim_robot
