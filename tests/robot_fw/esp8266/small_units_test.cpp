// Clock, tick schedule, reset causes, analogue inputs and LED.
#include <gtest/gtest.h>

#include "chip.hpp"
#include "robot_fw/esp8266/analogue_inputs.hpp"
#include "robot_fw/esp8266/reset_cause.hpp"
#include "robot_fw/esp8266/status_led.hpp"
#include "robot_fw/esp8266/tick_schedule.hpp"
#include "robot_fw/esp8266/wide_clock.hpp"

namespace robot_fw::esp8266 {
namespace {

TEST(WideClock, GoesOnOverTheWrapOfTheCounter) {
  chip = Chip{};
  chip.counter_us = 0xFFFF'FF00;
  WideClock clock;
  std::uint64_t last_us = clock.now_us();
  EXPECT_EQ(last_us, 0xFFFF'FF00U);
  for (int wrap = 0; wrap < 3; ++wrap) {
    for (int i = 0; i < 8; ++i) {
      chip.pass(0x2000'0000);
      const std::uint64_t now_us = clock.now_us();
      EXPECT_EQ(now_us - last_us, 0x2000'0000U);
      last_us = now_us;
    }
  }
}

TEST(TickSchedule, MissedTicksAreCountedNotCaughtUp) {
  TickSchedule ticks{10'000};
  ticks.begin(1'000);
  EXPECT_EQ(ticks.take(1'000), 1'000U);
  EXPECT_FALSE(ticks.due(10'999));
  // Due at 11 000, 21 000, 31 000 and 41 000; the program comes back 35 ms after the first of them.
  ASSERT_TRUE(ticks.due(46'000));
  EXPECT_EQ(ticks.take(46'000), 41'000U);
  EXPECT_EQ(ticks.missed(), 3U);
  EXPECT_FALSE(ticks.due(46'000)) << "one tick, not four";
  EXPECT_TRUE(ticks.due(51'000)) << "the rhythm stays";
  EXPECT_EQ(ticks.take(52'500), 51'000U);
  EXPECT_EQ(ticks.missed(), 3U);
}

TEST(ResetCause, WatchdogCrashAndBrownOutAreDistinguishedFromTheOthers) {
  EXPECT_EQ(reset_cause(0, false), rheonaut_RESET_CAUSE_POWER_ON);
  EXPECT_EQ(reset_cause(0, true), rheonaut_RESET_CAUSE_BROWN_OUT);
  for (const std::uint32_t reason : {1U, 2U, 3U}) EXPECT_EQ(reset_cause(reason, true), rheonaut_RESET_CAUSE_WATCHDOG);
  EXPECT_EQ(reset_cause(4, true), rheonaut_RESET_CAUSE_SOFTWARE);
  EXPECT_EQ(reset_cause(6, true), rheonaut_RESET_CAUSE_EXTERNAL);
  EXPECT_EQ(reset_cause(5, true), rheonaut_RESET_CAUSE_UNKNOWN);
}

TEST(AnalogueInputs, ScaleTheElectrode) {
  chip = Chip{};
  AnalogueInputs inputs{{.impedance_scale = 2.0F}};
  inputs.begin();
  chip.analogue = 1023;
  inputs.read();
  EXPECT_FLOAT_EQ(inputs.impedance_mv(), 2000);
  EXPECT_EQ(inputs.supply_mv(), 0);
}

TEST(AnalogueInputs, ReadTheSupplyOnceASecondThroughTheSwitch) {
  chip = Chip{};
  chip.supply_pin = 15;
  AnalogueInputs inputs{{.supply_pin = 15, .supply_scale = 4.0F}};
  inputs.begin();
  chip.analogue = 1023;
  chip.analogue_with_supply = 900;
  for (int tick = 0; tick < 300; ++tick) {
    inputs.read();
    if (tick >= 2) {
      EXPECT_FLOAT_EQ(inputs.impedance_mv(), 1000) << tick;
      EXPECT_NEAR(inputs.supply_mv(), 900 * 4 * 1000 / 1023.0, 0.01) << tick;
    }
  }
}

TEST(StatusLed, PatternsDiffer) {
  const auto lit_ms = [](LedPattern pattern) {
    int count = 0;
    for (std::uint64_t ms = 0; ms < 2000; ++ms) count += lit(pattern, ms * 1000);
    return count;
  };
  const auto flashes = [](LedPattern pattern) {
    int count = 0;
    for (std::uint64_t ms = 0; ms < 2000; ++ms) count += lit(pattern, ms * 1000) && !lit(pattern, (ms + 1) * 1000);
    return count;
  };
  EXPECT_EQ(flashes(LedPattern::connecting), 2);
  EXPECT_EQ(flashes(LedPattern::connected), 1);
  EXPECT_EQ(flashes(LedPattern::refused), 3);
  EXPECT_EQ(flashes(LedPattern::emergency), 10);
  EXPECT_EQ(lit_ms(LedPattern::connected), 100);
}

TEST(StatusLed, IsLitByALowPinOnTheModule) {
  chip = Chip{};
  StatusLed led{kSettings.led};
  led.begin();
  EXPECT_TRUE(chip.level(2));
  led.show(LedPattern::connected, 0);
  EXPECT_FALSE(chip.level(2));
}

}  // namespace
}  // namespace robot_fw::esp8266
