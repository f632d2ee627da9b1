// Each rule by which a sensor is not believed, and the one by which it is again.
#include "robot_fw/core/sensor_watch.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace robot_fw {
namespace {

constexpr SensorRules kRules{-10, 10, 3, 6, 4};  // missing after 3, stuck after 6, wrong after 4

class Watched : public ::testing::Test {
 protected:
  // Good readings, each another.
  void good(int readings) {
    for (int i = 0; i < readings; ++i) changes += watch.step(next(), true);
  }
  void equal(float reading, int readings) {
    for (int i = 0; i < readings; ++i) changes += watch.step(reading, true);
  }
  void wrong(int readings) {
    for (int i = 0; i < readings; ++i) changes += watch.step(20 + next(), true);
  }
  void silent(int ticks) {
    for (int i = 0; i < ticks; ++i) changes += watch.step(99, false);
  }
  float next() { return last = last < 0 ? 1 : -1; }

  SensorWatch watch{kRules};
  float last = 1;
  int changes = 0;
};

TEST_F(Watched, IsBelievedFromTheStart) {
  EXPECT_EQ(watch.fault(), SensorFault::none);
  good(1000);
  EXPECT_EQ(watch.fault(), SensorFault::none);
  EXPECT_EQ(changes, 0);
}

TEST_F(Watched, IsMissingAfterSoManyTicksWithoutAReading) {
  good(5);
  silent(2);
  EXPECT_EQ(watch.fault(), SensorFault::none);
  silent(1);
  EXPECT_EQ(watch.fault(), SensorFault::missing);
  silent(100);
  EXPECT_EQ(changes, 1) << "news once, not in every tick";
}

TEST_F(Watched, IsMissingAtOnceWhenItNeverSaidAnything) {
  silent(1);
  EXPECT_EQ(watch.fault(), SensorFault::missing);
}

TEST_F(Watched, OneThatIsDistrustedIsMissingUntilItHasBeenGoodForLongEnough) {
  watch.distrust();
  good(49);
  EXPECT_EQ(watch.fault(), SensorFault::missing);
  good(1);
  EXPECT_EQ(watch.fault(), SensorFault::none);
}

TEST_F(Watched, IsNotMissingWhenAReadingComesInBetween) {
  good(1);
  for (int i = 0; i < 20; ++i) {
    silent(2);
    good(1);
  }
  EXPECT_EQ(changes, 0);
}

TEST_F(Watched, IsStuckAfterSoManyEqualReadings) {
  equal(5, 5);
  EXPECT_EQ(watch.fault(), SensorFault::none);
  equal(5, 1);
  EXPECT_EQ(watch.fault(), SensorFault::stuck);
  EXPECT_EQ(changes, 1);
}

TEST_F(Watched, AnotherReadingStartsTheCountAnew) {
  equal(5, 5);
  equal(4, 5);
  EXPECT_EQ(watch.fault(), SensorFault::none);
}

TEST_F(Watched, TicksWithoutAReadingAreNotEqualReadings) {
  equal(5, 4);
  silent(2);
  EXPECT_EQ(watch.fault(), SensorFault::none);
  equal(5, 2);
  EXPECT_EQ(watch.fault(), SensorFault::stuck);
}

TEST_F(Watched, IsNeverStuckWhereThatIsNotLookedFor) {
  watch = SensorWatch{{-10, 10, 3, 0, 4}};
  equal(5, 10'000);
  EXPECT_EQ(watch.fault(), SensorFault::none);
}

TEST_F(Watched, IsOutOfRangeAfterSoManyWrongReadings) {
  wrong(3);
  EXPECT_EQ(watch.fault(), SensorFault::none);
  wrong(1);
  EXPECT_EQ(watch.fault(), SensorFault::out_of_range);
  EXPECT_EQ(changes, 1);
}

TEST_F(Watched, AGoodReadingStartsThatCountAnew) {
  for (int i = 0; i < 20; ++i) {
    wrong(3);
    good(1);
  }
  EXPECT_EQ(changes, 0);
}

TEST_F(Watched, TheEndsOfTheRangeBelongToIt) {
  EXPECT_TRUE(watch.in_range(-10));
  EXPECT_TRUE(watch.in_range(10));
  EXPECT_FALSE(watch.in_range(10.001F));
  EXPECT_FALSE(watch.in_range(-10.001F));
}

TEST_F(Watched, WhatIsNotANumberIsOutOfRange) {
  equal(std::numeric_limits<float>::quiet_NaN(), 4);
  EXPECT_EQ(watch.fault(), SensorFault::out_of_range);
}

TEST_F(Watched, IsBelievedAgainAfterFiftyGoodReadingsInARow) {
  silent(3);
  good(49);
  EXPECT_EQ(watch.fault(), SensorFault::missing);
  good(1);
  EXPECT_EQ(watch.fault(), SensorFault::none);
  EXPECT_EQ(changes, 2);
}

TEST_F(Watched, OneWrongReadingOrSilentTickStartsThoseFiftyAnew) {
  silent(3);
  good(49);
  wrong(1);
  good(49);
  silent(1);
  good(49);
  EXPECT_EQ(watch.fault(), SensorFault::missing);
  good(1);
  EXPECT_EQ(watch.fault(), SensorFault::none);
}

TEST_F(Watched, AStuckSensorIsBelievedAgainOnlyOnceItMoves) {
  equal(5, 1000);
  EXPECT_EQ(watch.fault(), SensorFault::stuck);
  good(50);
  EXPECT_EQ(watch.fault(), SensorFault::none);
}

TEST_F(Watched, OneFaultMayBecomeAnother) {
  wrong(4);
  silent(3);
  EXPECT_EQ(watch.fault(), SensorFault::missing);
  EXPECT_EQ(changes, 2);
  wrong(4);
  EXPECT_EQ(watch.fault(), SensorFault::out_of_range);
  EXPECT_EQ(changes, 3);
}

TEST_F(Watched, AFaultThatLastsForDaysStaysOne) {
  silent(100'000);
  EXPECT_EQ(watch.fault(), SensorFault::missing);
  EXPECT_EQ(changes, 1);
}

}  // namespace
}  // namespace robot_fw
