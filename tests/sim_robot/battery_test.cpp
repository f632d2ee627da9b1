// The battery sags under load, recovers, runs down, and takes the motor's effect with it.
#include "sim_robot/world/battery.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

#include "sim_robot/world/world.hpp"

namespace sim_robot {
namespace {

TEST(Battery, NeverSagsByDefault) {
  Battery battery{{}};
  for (int k = 0; k < 1000; ++k) battery.step(1);
  EXPECT_EQ(battery.supply_mv(), 3000);
  EXPECT_EQ(battery.supply_ratio(), 1);
}

TEST(Battery, SagsInProportionToTheDutyEitherWayAndRecovers) {
  Battery battery{{.sag_mv = 280}};
  battery.step(0.5);
  EXPECT_DOUBLE_EQ(battery.supply_mv(), 2860);
  battery.step(-1);
  EXPECT_DOUBLE_EQ(battery.supply_mv(), 2720);
  battery.step(0);
  EXPECT_DOUBLE_EQ(battery.supply_mv(), 3000);
}

TEST(Battery, RunsDownByTheHourAndFasterUnderLoad) {
  Battery idle{kCr123a}, driven{kCr123a};
  for (int k = 0; k < 360'000; ++k) {
    idle.step(0);
    driven.step(1);
  }
  EXPECT_NEAR(idle.supply_mv(), 3000 - 27, 1e-6);
  EXPECT_NEAR(driven.supply_mv(), 3000 - 27 - 233 - 280, 1e-6);
}

TEST(Battery, EndsAtZero) {
  Battery battery{{.sag_mv = 5000}};
  battery.step(1);
  EXPECT_EQ(battery.supply_mv(), 0);
}

TEST(Battery, AWeakOneMovesTheRobotLessAndTheCoreReadsItsVoltage) {
  WorldConfig fresh, weak;
  weak.battery.open_circuit_mv = 2400;
  World strong_robot{fresh}, weak_robot{weak};
  for (int k = 0; k < 500; ++k) {
    strong_robot.step(0.5);
    weak_robot.step(0.5);
  }
  EXPECT_NEAR(weak_robot.position_m(), 0.8 * strong_robot.position_m(), 1e-12);
  EXPECT_EQ(weak_robot.read(0).supply_mv, 2400);
}

TEST(Battery, AMotorInItsDeadZoneDrawsNothing) {
  WorldConfig config;
  config.motor.dead_zone_duty = 0.1;
  config.battery.sag_mv = 1000;
  World world{config};
  world.step(0.05);
  EXPECT_EQ(world.supply_mv(), 3000);
}

TEST(Battery, RefusesWhatCannotBe) {
  EXPECT_THROW(check(BatteryParameters{.open_circuit_mv = 0}), std::invalid_argument);
  EXPECT_THROW(check(BatteryParameters{.sag_mv = -1}), std::invalid_argument);
}

}  // namespace
}  // namespace sim_robot
