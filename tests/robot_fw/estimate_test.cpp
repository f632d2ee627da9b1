// The whole robot on its accelerometer, as it runs on the board: what it does, and what its telemetry says of it.
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "tests/robot_fw/driven_robot.hpp"

namespace robot_fw {
namespace {

using namespace sim_robot;

constexpr int kSeeds = 40;  // docs/robot.md has 200 of the estimator alone

SimulatedRobotConfig on_its_accelerometer(std::uint64_t seed) {
  SimulatedRobotConfig config;
  config.boot_id = kBootId;
  config.world.imu = ImuParameters{};
  config.world.seed = seed;
  return config;
}

struct Outcome {
  double target_error_m = 0;    // true position from the true target
  double estimate_error_m = 0;  // telemetry's position, without the disturbance, from the true one
  double position_sd_m = 0;
};

// The paper's Figure 7: 0.1 m, and -0.05 m on the measured position from 20 s on; judged at 42 s.
Outcome figure_7(std::uint64_t seed, bool is_confirmed) {
  constexpr float kSetpointM = 0.1F, kDisturbanceM = -0.05F;
  SimulatedRobot robot{on_its_accelerometer(seed)};
  StationPeer station{robot};
  station.connect();
  station.run(2);
  if (is_confirmed) station.send(set_parameter("model_confirmed", 1));
  station.send(set_auto(kSetpointM));
  station.run(2000);
  station.send(inject_disturbance(kDisturbanceM));
  station.run(2200);
  const auto& last = station.samples.rbegin()->second;
  const double true_m = robot.world().position_m();
  return {true_m - static_cast<double>(kSetpointM - kDisturbanceM),
          static_cast<double>(last.position_m - kDisturbanceM) - true_m, static_cast<double>(last.position_sd_m)};
}

TEST(OnItsAccelerometer, TheRobotEndsFigure7Within5MmOfTheTrueTarget) {
  int within_5_mm = 0, within_2_sd = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const Outcome outcome = figure_7(seed, true);
    within_5_mm += std::abs(outcome.target_error_m) <= 0.005;
    within_2_sd += std::abs(outcome.estimate_error_m) <= 2 * outcome.position_sd_m;
  }
  EXPECT_GE(within_5_mm, 0.95 * kSeeds);
  EXPECT_GE(within_2_sd, 0.9 * kSeeds);
}

// As it comes, the robot does not know that its model is the fluid's: less exact, and as honest.
TEST(OnItsAccelerometer, WithAModelThatNobodyHasConfirmedItIsWithin10MmAndSaysHowWellItKnows) {
  int within_10_mm = 0, within_2_sd = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const Outcome outcome = figure_7(seed, false);
    within_10_mm += std::abs(outcome.target_error_m) <= 0.01;
    within_2_sd += std::abs(outcome.estimate_error_m) <= 2 * outcome.position_sd_m;
  }
  EXPECT_GE(within_10_mm, 0.95 * kSeeds);
  EXPECT_GE(within_2_sd, 0.9 * kSeeds);
}

class Estimate : public DrivenRobot {
 protected:
  Estimate() : DrivenRobot(on_its_accelerometer(1)) {}
};

TEST_F(Estimate, TheStandardDeviationGoesInStepsSoThatBatchesStayLong) {
  order(set_auto(0.1F));
  station.run(4200);
  int changes = 0;
  float before_m = 0;
  for (const auto& [seq, sample] : station.samples) {
    changes += sample.position_sd_m != before_m;
    before_m = sample.position_sd_m;
  }
  EXPECT_GT(before_m, 0.0005F);
  EXPECT_LT(before_m, 0.02F);
  EXPECT_GE(changes, 3);
  EXPECT_LE(changes, 20);
}

TEST_F(Estimate, ZeroPositionMakesThePositionKnown) {
  order(set_auto(0.05F));
  station.run(500);
  order(set_manual());
  station.run(100);
  EXPECT_NEAR(last().position_m, 0.05, 0.005);
  EXPECT_EQ(answer(zero_position()), "accepted");
  station.step();
  EXPECT_NEAR(last().position_m, 0, 0.0002);
  EXPECT_LE(last().position_sd_m, 0.0002F);
}

// The way out is open at once, not only from the next tick on.
TEST_F(Estimate, AfterZeroPositionADutyTowardsALimitIsAcceptedWithinTheSameTick) {
  EXPECT_EQ(answer(set_parameter("position_limit_max_m", 0.2F)), "accepted");
  order(set_duty(0.5F));
  for (int i = 1; i < 1000 && core().duty() > 0; ++i) {
    if (i % 20 == 0) station.send(renew_lease());
    station.step();
  }
  ASSERT_EQ(events_of(rheonaut_EVENT_KIND_POSITION_UNCERTAIN), 1);
  station.run(1000);
  const auto refused = station.send(set_duty(0.2F));
  const auto zeroed = station.send(zero_position());
  const auto accepted = station.send(set_duty(0.2F));
  station.step();
  EXPECT_EQ(result(*station.ack_of(refused)), "uncertain");
  EXPECT_EQ(result(*station.ack_of(zeroed)), "accepted");
  EXPECT_EQ(result(*station.ack_of(accepted)), "accepted");
  EXPECT_EQ(core().duty(), 0.2F);
}

TEST_F(Estimate, AfterZeroPositionASetpointNearALimitIsAcceptedWithinTheSameTick) {
  EXPECT_EQ(answer(set_parameter("position_limit_max_m", 0.5F)), "accepted");
  order(set_auto(0.1F));
  station.run(1000);
  order(set_manual());
  station.run(1000);
  const float near_m = 0.5F - last().position_sd_m;
  EXPECT_EQ(answer(set_auto(near_m)), "uncertain");
  const auto zeroed = station.send(zero_position());
  const auto accepted = station.send(set_auto(near_m));
  station.step();
  EXPECT_EQ(result(*station.ack_of(zeroed)), "accepted");
  EXPECT_EQ(result(*station.ack_of(accepted)), "accepted");
}

TEST_F(Estimate, FollowsTheMotorThroughMissedTicks) {
  order(set_duty(0.5F));
  station.run(20);
  robot.skip(4);
  station.run(200);  // the lease has ended by then
  EXPECT_EQ(core().duty(), 0);
  EXPECT_NEAR(last().position_m, robot.world().position_m(), 0.003);
}

TEST(OnItsAccelerometer, AnotherFluidIsAnEventWithin5S) {
  SimulatedRobotConfig config = on_its_accelerometer(3);
  config.world.plant.model = control::kNewtonianModel;
  SimulatedRobot robot{config};
  StationPeer station{robot};
  station.connect();
  station.run(2);
  station.send(set_auto(0.1F));
  station.run(500);
  int mismatches = 0;
  for (const auto& event : station.events) {
    if (event.kind != rheonaut_EVENT_KIND_MODEL_MISMATCH) continue;
    ++mismatches;
    EXPECT_TRUE(std::isfinite(event.value));
  }
  EXPECT_EQ(mismatches, 1);
}

TEST(OnItsAccelerometer, TheWatersParametersSetOverTheLinkServeInWater) {
  SimulatedRobotConfig config = on_its_accelerometer(3);
  config.world.plant.model = control::kNewtonianModel;
  SimulatedRobot robot{config};
  StationPeer station{robot};
  station.connect();
  station.run(2);
  for (std::size_t i = 0; i < kModelSections; ++i) {
    const std::string number = std::to_string(i + 1);
    station.send(set_parameter(("model_gain_" + number + "_m_s").c_str(), kWaterVelocityModel.gain_m_s[i]));
    station.step();
    station.send(
        set_parameter(("model_time_constant_" + number + "_s").c_str(), kWaterVelocityModel.time_constant_s[i]));
    station.step();
  }
  station.send(set_parameter("model_confirmed", 1));
  station.step();
  for (const auto& ack : station.acks) EXPECT_EQ(ack.result, rheonaut_COMMAND_RESULT_ACCEPTED);
  station.send(set_auto(0.1F));
  station.run(4200);
  for (const auto& event : station.events) EXPECT_NE(event.kind, rheonaut_EVENT_KIND_MODEL_MISMATCH);
  EXPECT_NEAR(station.samples.rbegin()->second.position_m, robot.world().position_m(), 0.005);
}

// SAFETY: the robot does not go where it may be beyond a limit already.
TEST_F(Estimate, ASetpointNearerToALimitThanThePositionIsKnownIsRefused) {
  EXPECT_EQ(answer(set_parameter("position_limit_max_m", 0.2F)), "accepted");
  EXPECT_EQ(answer(set_auto(0.19F)), "accepted");  // at the start the position is known
  station.run(300);
  order(set_manual());
  const float margin_m = 2 * last().position_sd_m;
  ASSERT_GT(margin_m, 0.004F);
  EXPECT_EQ(answer(set_auto(0.2F - 0.9F * margin_m)), "uncertain");
  EXPECT_EQ(mode(), "manual");
  EXPECT_EQ(answer(set_auto(0.1F)), "accepted");
  EXPECT_EQ(answer(set_setpoint(0.2F - 0.9F * margin_m)), "uncertain");
}

// SAFETY: motion that leads there ends, before the limit and its emergency, and turning round is allowed.
TEST_F(Estimate, MotionTowardsALimitEndsWhereThePositionIsNoLongerKnownWellEnough) {
  EXPECT_EQ(answer(set_parameter("position_limit_max_m", 0.2F)), "accepted");
  order(set_duty(0.5F));
  for (int i = 1; i < 1000 && core().duty() > 0; ++i) {
    if (i % 20 == 0) station.send(renew_lease());
    station.step();
  }
  EXPECT_EQ(mode(), "manual");
  EXPECT_EQ(core().duty(), 0);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_POSITION_UNCERTAIN), 1);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_EMERGENCY), 0);
  EXPECT_LT(last().position_m, 0.2F);
  EXPECT_GE(last().position_m + 2 * last().position_sd_m, 0.2F);
  EXPECT_LT(robot.world().position_m(), 0.2);
  station.run(1000);
  EXPECT_EQ(answer(set_duty(0.2F)), "uncertain");
  EXPECT_EQ(answer(set_duty(-0.2F)), "accepted");
  order(set_duty(0));
  station.run(1000);
  EXPECT_EQ(answer(zero_position()), "accepted");  // the way out: somebody has seen where it is
  EXPECT_EQ(answer(set_duty(0.2F)), "accepted");
}

// SAFETY: the loop steers outward as well as somebody's duty does, and what waits would go on with it.
TEST_F(Estimate, InAutoMotionTowardsALimitEndsAsWellAndWhatWaitsIsDropped) {
  EXPECT_EQ(answer(set_parameter("position_limit_max_m", 0.2F)), "accepted");
  EXPECT_EQ(answer(set_auto(0.19F)), "accepted");
  const std::uint64_t later = station.send(timed(set_setpoint(-0.1F), robot.robot_time_us() + 2'000'000));
  for (int i = 0; i < 800 && mode() == "auto"; ++i) {
    if (i % 20 == 1) station.send(renew_lease());  // what waits lives by it
    station.step();
  }
  ASSERT_EQ(mode(), "manual");
  EXPECT_EQ(core().duty(), 0);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_POSITION_UNCERTAIN), 1);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_MODE_CHANGED), 2);  // to auto, and back
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_EMERGENCY), 0);
  EXPECT_LT(robot.world().position_m(), 0.2);
  station.run(2);
  EXPECT_EQ(result(*station.ack_of(later)), "uncertain");
}

// The flag is set from the event of its beginning to that of its end.
TEST(OnItsAccelerometer, AMismatchIsInTelemetryFromItsBeginningToItsEnd) {
  SimulatedRobotConfig config = on_its_accelerometer(1);
  config.world.plant = {.model = control::kNewtonianModel};
  SimulatedRobot robot{config};
  StationPeer station{robot};
  station.welcome.samples_per_frame = 1;
  station.connect();
  station.run(2);
  station.send(set_parameter("model_confirmed", 1));
  const auto is_flagged = [&] {
    return (station.samples.rbegin()->second.flags & rheonaut_TELEMETRY_FLAG_MODEL_MISMATCH) != 0;
  };
  const auto events_of = [&](protocol::EventKind kind) {
    return std::ranges::count(station.events, kind, &protocol::Event::kind);
  };
  station.run(100);
  EXPECT_FALSE(is_flagged());
  for (int i = 0; i < 15; ++i) {
    station.send(set_duty(0.3F));
    station.run(20);
  }
  EXPECT_TRUE(is_flagged());
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_MODEL_MISMATCH), 1);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_MODEL_MISMATCH_ENDED), 0);
  station.run(1000);
  station.send(set_parameter("model_gain_error", 0.15F));  // another model is another chance
  station.run(5);
  EXPECT_FALSE(is_flagged());
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_MODEL_MISMATCH_ENDED), 1);
}

// What nobody would set, but the table allows, and a short drive: the robot still takes better parameters afterwards.
TEST(OnItsAccelerometer, NoParametersLockThemselves) {
  const std::vector<std::vector<float>> gains{{10, -9.9F, -9.9F, 9.9F}, {10, 10, 10, 10}, {-10, 10, -10, 10}};
  const std::vector<std::vector<float>> time_constants{{1000, 0.001F, 1000, 0.001F}, {0.001F, 0.1F, 10, 1000}};
  const std::vector<std::vector<std::pair<const char*, float>>> others{
      {{"dead_zone_duty", 0.5F}, {"doubtful_duty", 0.5F}, {"model_gain_error", 1}, {"model_shape_error", 1}},
      {{"acceleration_noise_m_s2", 1}, {"acceleration_bias_m_s2", 1}, {"acceleration_bias_walk_m_s2", 0.1F}},
      {{"acceleration_noise_m_s2", 0.001F},
       {"model_gain_error", 0.01F},
       {"model_shape_error", 0.001F},
       {"driven_velocity_sd_m_s", 1e-5F},
       {"resting_velocity_sd_m_s", 1e-5F},
       {"velocity_correlation_s", 10}}};
  std::uint64_t seed = 1;
  for (const auto& gain : gains) {
    for (const auto& time_constant : time_constants) {
      for (const auto& other : others) {
        SimulatedRobot robot{on_its_accelerometer(seed++)};
        StationPeer station{robot};
        station.connect();
        station.run(2);
        const auto answer = [&](const char* name, float value) {
          const std::uint64_t id = station.send(set_parameter(name, value));
          station.run(3);
          const auto ack = station.ack_of(id);
          return ack && ack->result == rheonaut_COMMAND_RESULT_ACCEPTED;
        };
        for (const auto& [name, value] : other) EXPECT_TRUE(answer(name, value)) << name;
        for (std::size_t i = 0; i < gain.size(); ++i) {
          const std::string n = std::to_string(i + 1);
          EXPECT_TRUE(answer(("model_gain_" + n + "_m_s").c_str(), gain[i]));
          EXPECT_TRUE(answer(("model_time_constant_" + n + "_s").c_str(), time_constant[i]));
        }
        for (int i = 0; i < 5; ++i) {
          station.send(set_duty(0.8F));
          station.run(20);
        }
        station.run(4000);
        EXPECT_TRUE(answer("model_gain_1_m_s", 0.1F)) << gain[1] << ' ' << time_constant[0] << ' ' << other[0].first;
      }
    }
  }
}

TEST_F(Estimate, ItsParametersAreRefusedWhileTheRobotCoasts) {
  order(set_duty(1));
  station.run(45);
  order(emergency_stop());
  EXPECT_EQ(answer(set_parameter("model_gain_error", 0.2F)), "motor_on");
  EXPECT_EQ(answer(set_parameter("auto_limit_s", 100)), "accepted");
  station.run(3000);  // the fluid remembers for long
  EXPECT_EQ(answer(set_parameter("model_gain_error", 0.2F)), "accepted");
  station.run(500);
  EXPECT_LE(std::abs(last().position_m - static_cast<float>(robot.world().position_m())), 2 * last().position_sd_m);
}

// SAFETY: the estimator would take the coasting robot to stand, and be sure of that.
TEST_F(Estimate, ItsParametersAreRefusedWhileTheRobotCoastsWithoutReadings) {
  station.run(600);  // at rest, and felt to be
  robot.world().set_fault(Sensor::accelerometer, {.kind = SensorFaultKind::missing});
  station.step();
  EXPECT_EQ(answer(set_parameter("model_confirmed", 1)), "accepted");
  order(set_duty(1));
  station.run(45);
  order(set_duty(0));
  EXPECT_EQ(answer(set_parameter("model_gain_error", 0.2F)), "motor_on");
}

TEST(OnItsAccelerometer, ARobotThatWasResetMayBeCoastingAndSaysSo) {
  for (const auto [cause, sd_m] :
       {std::pair{rheonaut_RESET_CAUSE_POWER_ON, 0.0F}, std::pair{rheonaut_RESET_CAUSE_SOFTWARE, 0.025F},
        std::pair{rheonaut_RESET_CAUSE_BROWN_OUT, 0.025F}}) {
    SimulatedRobotConfig config = on_its_accelerometer(1);
    config.reset_cause = cause;
    SimulatedRobot robot{config};
    StationPeer station{robot};
    station.connect();
    station.run(20);
    EXPECT_GE(station.samples.rbegin()->second.position_sd_m, sd_m);
    if (sd_m == 0) EXPECT_LE(station.samples.rbegin()->second.position_sd_m, 0.001F);
  }
}

}  // namespace
}  // namespace robot_fw
