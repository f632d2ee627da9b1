// The motor's pin through boot, setup, crash and reset, with the sketch as it is flashed.
#include "board_fixture.hpp"

extern "C" void preinit();
extern "C" void custom_crash_callback(struct rst_info*, std::uint32_t, std::uint32_t);
void setup();
void loop();

namespace robot_fw::esp8266 {
namespace {

class SafeBoot : public BoardFixture {};

TEST_F(SafeBoot, PinIsLowBeforeDuringAndAfterSetup) {
  for (const bool left_high : {false, true}) {
    chip.reset(left_high ? 3 : 0);
    chip.pins[kMotorPin].latch = left_high;  // a software reset leaves it
    preinit();
    EXPECT_FALSE(chip.pins[kMotorPin].latch);
    chip.pass(1'000);
    setup();
    for (int i = 0; i < 1'000; ++i) {
      chip.pass(kTurnUs);
      loop();
    }
    EXPECT_EQ(chip.pins[kMotorPin].high_us, 0U);
    EXPECT_TRUE(chip.pins[kMotorPin].output) << "driven low, not left open";
  }
}

TEST_F(SafeBoot, PinIsNoOutputUntilItIsLow) {
  chip.pins[kMotorPin].latch = true;
  boot();
  EXPECT_TRUE(chip.pins[kMotorPin].output);
  EXPECT_EQ(chip.pins[kMotorPin].rises, 0);
  EXPECT_EQ(chip.pins[kMotorPin].high_us, 0U);
  EXPECT_FALSE(chip.level(kMotorPin));
}

TEST_F(SafeBoot, WatchdogRunsAndTicksFeedIt) {
  boot();
  EXPECT_EQ(chip.watchdog_enables, 1);
  run_ms(100);
  EXPECT_NEAR(chip.watchdog_feeds, 10, 1);
}

TEST_F(SafeBoot, HangAndCrashTurnTheMotorOff) {
  connect();
  drive(1);
  ASSERT_TRUE(chip.level(kMotorPin));
  custom_crash_callback(nullptr, 0, 0);
  EXPECT_FALSE(chip.level(kMotorPin));
  EXPECT_EQ(motor_high_us([] { chip.pass(500'000); }), 0U) << "the interrupt does not raise it again";
}

TEST_F(SafeBoot, NoTickMeansNoMotorHoweverLongTheProgramHangs) {
  connect();
  drive(1);
  chip.pass(50'000);
  EXPECT_EQ(motor_high_us([] { chip.pass(10'000'000); }), 0U);
}

TEST_F(SafeBoot, PinStaysLowUntilAnOrderCameAndATickCompleted) {
  connect();
  EXPECT_EQ(chip.pins[kMotorPin].high_us, 0U);
  order(sim_robot::set_duty(1, 500));
  while (chip.now_us % 10'000 != 2'000) chip.pass(kTurnUs);
  board->step();
  board->step();
  EXPECT_FALSE(chip.level(kMotorPin)) << "the command is read, the tick not yet due";
  run_ms(10);
  EXPECT_TRUE(chip.level(kMotorPin));
}

}  // namespace
}  // namespace robot_fw::esp8266
