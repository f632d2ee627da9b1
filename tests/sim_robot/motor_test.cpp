// The motor stands still in its dead zone, lags as its time constant says, and weakens with the supply.
#include "sim_robot/world/motor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "sim_robot/world/tick.hpp"

namespace sim_robot {
namespace {

TEST(Motor, PassesTheDutyOnWithoutADeadZoneAndALag) {
  Motor motor{{}};
  for (const double duty : {0.3, -1.0, 0.001, 0.0}) EXPECT_EQ(motor.step(duty, 1), duty);
}

TEST(Motor, StandsStillBelowItsDeadZoneEitherWay) {
  Motor motor{{.dead_zone_duty = 0.03}};
  EXPECT_EQ(motor.step(0.0299, 1), 0);
  EXPECT_EQ(motor.step(-0.0299, 1), 0);
  EXPECT_EQ(motor.step(0.03, 1), 0.03);
  EXPECT_EQ(motor.step(-0.03, 1), -0.03);
}

TEST(Motor, DrivesTheOtherWayWithItsWiresSwapped) {
  Motor motor{{.dead_zone_duty = 0.03, .is_reversed = true}};
  EXPECT_EQ(motor.step(0.3, 1), -0.3);
  EXPECT_EQ(motor.step(-0.3, 1), 0.3);
  EXPECT_EQ(motor.step(0.02, 1), 0);
  EXPECT_EQ(motor.driven(0.3), 0.3) << "the battery feeds the same";
}

TEST(Motor, LagsByItsTimeConstantAndLosesNoTravel) {
  constexpr double kTimeConstantS = 0.05, kEndS = 2;
  Motor motor{{.time_constant_s = kTimeConstantS}};
  double travel_s = 0;
  for (double time_s = 0; time_s < kEndS - kTickS / 2; time_s += kTickS) {
    const double from = std::exp(-time_s / kTimeConstantS), to = std::exp(-(time_s + kTickS) / kTimeConstantS);
    const double mean = 1 - kTimeConstantS / kTickS * (from - to);  // of 1 - e^{-t/τ} over the tick
    const double duty = motor.step(1, 1);
    ASSERT_NEAR(duty, mean, 1e-12) << time_s;
    travel_s += kTickS * duty;
  }
  EXPECT_NEAR(travel_s, kEndS - kTimeConstantS, 1e-9);
}

TEST(Motor, IsAsStrongAsTheSupply) {
  Motor motor{{}};
  EXPECT_DOUBLE_EQ(motor.step(0.5, 0.8), 0.4);
}

TEST(Motor, RefusesWhatCannotBe) {
  EXPECT_THROW(check(MotorParameters{.dead_zone_duty = 1}), std::invalid_argument);
  EXPECT_THROW(check(MotorParameters{.dead_zone_duty = -0.1}), std::invalid_argument);
  EXPECT_THROW(check(MotorParameters{.time_constant_s = std::nan("")}), std::invalid_argument);
}

}  // namespace
}  // namespace sim_robot
