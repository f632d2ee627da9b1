// The paper's closed-loop experiment through the whole system: command checks, link, core, plant, recorder, SQLite.
#include <fstream>
#include <nlohmann/json.hpp>

#include "control/responses/step_metrics.hpp"
#include "tests/system/station_fixture.hpp"

namespace server {
namespace {

class DriveAndRecordTest : public SystemTest {
 protected:
  // Auto to 0.1 m, shifted by -0.05 m at sample 2000, 4000 samples in all; the samples from the start of auto on.
  std::vector<storage::StoredSample> perform(robot_fw::DutyRange duty) {
    sim_robot::SimulatedRobotConfig config;
    config.duty = duty;
    begin(config);
    const storage::RunId run = begin_run();
    const auto started = send(sim_robot::set_auto(0.1F)).expect_accepted();
    const std::uint64_t first_seq = started.effect_at_robot_us / 10'000 + 1;  // it acts in the next tick
    run_until_just_before(first_seq + 2000);
    send(sim_robot::inject_disturbance(-0.05F)).expect_accepted();
    run_until_just_before(first_seq + 4001);
    pass(0.1);
    const auto ended = wait_for(runs->end(run, "done"));
    EXPECT_EQ(ended->samples_lost, 0u);
    EXPECT_EQ(ended->samples_stored, ended->samples_expected);

    std::vector<storage::StoredSample> samples = samples_of(run);
    EXPECT_EQ(samples.size(), ended->samples_expected);
    std::erase_if(samples, [&](const storage::StoredSample& sample) { return sample.seq < first_seq; });
    EXPECT_EQ(samples.at(0).mode, rheonaut_MODE_AUTO);
    return samples;
  }

  static void expect_golden(const std::vector<storage::StoredSample>& samples, const std::string& duty_limits) {
    const auto golden = nlohmann::json::parse(std::ifstream(TEST_DATA_DIR "/closed_loop_cases.json"));
    for (const auto& row : golden["sampled"]) {
      if (row["plant"] != "Eq(29)" || row["duty_limits"] != duty_limits) continue;
      if (row["recurrence_memory"] != "unsaturated") continue;
      ASSERT_EQ(row["k"].size(), 99u);
      for (std::size_t i = 0; i < row["k"].size(); ++i) {
        EXPECT_NEAR(samples.at(row["k"][i]).sample.position_m, row["measured"][i], 1e-4) << "k = " << row["k"][i];
      }
      return;
    }
    FAIL() << "no such case";
  }

  static control::StepMetrics measure(const std::vector<storage::StoredSample>& samples,
                                      control::StepExperiment experiment) {
    std::vector<double> time_s, position_m;
    for (const storage::StoredSample& sample : samples) {
      time_s.push_back(static_cast<double>(sample.seq - samples[0].seq) * 0.01);
      position_m.push_back(sample.sample.position_m);
    }
    return control::measure_step(time_s, position_m, experiment);
  }

 private:
  void run_until_just_before(std::uint64_t seq) {
    const auto wait_us = robot->tick_at_us(seq) - 5000 - clock.steady_us();
    clock.run_for(microseconds{wait_us});
  }
};

TEST_F(DriveAndRecordTest, TheRecordedExperimentFollowsTheReference) {
  const auto samples = perform({-1, 1});
  expect_golden(samples, "-1..1");
  const auto step = measure(samples, {0, 20, 0, 0.1, 0.002});
  ASSERT_TRUE(step.settling_s.has_value());
  EXPECT_NEAR(*step.settling_s, 1.15, 0.05);
  EXPECT_NEAR(step.overshoot_percent, 0.45, 0.2);
  const auto disturbance = measure(samples, {20, 40, 0.05, 0.1, 0.002});
  ASSERT_TRUE(disturbance.settling_s.has_value());
  EXPECT_NEAR(*disturbance.settling_s, 0.63, 0.05);
}

TEST_F(DriveAndRecordTest, WithAOneWayMotorTheBuiltInControllerHardlyOvershoots) {
  const auto samples = perform({0, 1});
  EXPECT_EQ(samples.back().controller_id, robot_fw::kOneWayController.controller_id);
  const auto step = measure(samples, {0, 20, 0, 0.1, 0.002});
  ASSERT_TRUE(step.settling_s.has_value());
  EXPECT_NEAR(*step.settling_s, 1.77, 0.05);
  EXPECT_NEAR(step.overshoot_percent, 0.71, 0.05);
}

}  // namespace
}  // namespace server
