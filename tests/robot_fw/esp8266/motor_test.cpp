// The motor's pin: PWM, dead zone, direction, and the interrupt that turns it off when the ticks stop.
#include "robot_fw/esp8266/motor.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "chip.hpp"
#include "robot_fw/core/motion_sense.hpp"

namespace robot_fw::esp8266 {
namespace {

constexpr int kPin = 5, kDirection = 13;

class MotorOnChip : public ::testing::Test {
 protected:
  MotorOnChip() { chip = Chip{}; }

  std::uint64_t high_us(std::uint64_t us) {
    const std::uint64_t before = chip.pins[kPin].high_us;
    chip.pass(us);
    return chip.pins[kPin].high_us - before;
  }
  // 0.1 s of ticks with this duty; how much of the time the pin was high.
  double share(Motor& motor, float duty) {
    std::uint64_t high = 0;
    for (int i = 0; i < 10; ++i) {
      motor.complete_tick(duty);
      high += high_us(10'000);
    }
    return static_cast<double>(high) / 100'000;
  }
};

TEST(PwmShare, IsZeroForZeroAndLinearFromTheDeadZoneOn) {
  EXPECT_EQ(pwm_share(0, 0.2F), 0.0F);
  EXPECT_FLOAT_EQ(pwm_share(1e-6F, 0.2F), 0.2000008F);
  EXPECT_FLOAT_EQ(pwm_share(0.5F, 0.2F), 0.6F);
  EXPECT_FLOAT_EQ(pwm_share(-0.5F, 0.2F), 0.6F);
  EXPECT_EQ(pwm_share(1, 0.2F), 1.0F);
  EXPECT_EQ(pwm_share(7, 0.2F), 1.0F);
  EXPECT_EQ(pwm_share(NAN, 0.2F), 0.0F);
}

TEST_F(MotorOnChip, FollowsTheDutyInShareOfTime) {
  Motor motor{{.pwm_pin = kPin, .dead_zone = 0.2F}};
  motor.begin();
  EXPECT_EQ(share(motor, 0), 0);
  EXPECT_NEAR(share(motor, 0.5F), 0.6, 0.01);
  EXPECT_NEAR(share(motor, 1), 1, 0.01);
  EXPECT_EQ(share(motor, 0), 0);
}

TEST_F(MotorOnChip, RefusesWhatItCannotDo) {
  Motor motor{{.pwm_pin = kPin}};
  motor.begin();
  EXPECT_EQ(motor.duty_min(), 0);
  EXPECT_EQ(share(motor, -0.5F), 0);
  EXPECT_EQ(share(motor, NAN), 0);
}

TEST_F(MotorOnChip, TurnsTheBridgeOnlyWhileThePinIsLow) {
  Motor motor{{.pwm_pin = kPin, .direction_pin = kDirection}};
  EXPECT_EQ(motor.duty_min(), -1);
  motor.begin();
  EXPECT_NEAR(share(motor, -1), 1, 0.01);
  EXPECT_TRUE(chip.level(kDirection));
  motor.complete_tick(1);
  EXPECT_TRUE(motor.is_off());
  EXPECT_FALSE(chip.level(kPin));
  EXPECT_TRUE(chip.level(kDirection));
  EXPECT_EQ(high_us(10'000), 0U) << "a tick of 0, in which its current dies";
  motor.complete_tick(1);
  EXPECT_FALSE(chip.level(kPin)) << "until the interrupt comes";
  EXPECT_FALSE(chip.level(kDirection));
  EXPECT_NEAR(share(motor, 1), 1, 0.02);
}

TEST_F(MotorOnChip, StopBetweenTicksDoesNotReplaceTheTickOfZero) {
  Motor motor{{.pwm_pin = kPin, .direction_pin = kDirection}};
  motor.begin();
  share(motor, 1);
  motor.complete_tick(1);
  chip.pass(9'000);
  motor.follow(0);
  chip.pass(1'000);
  motor.complete_tick(-1);
  EXPECT_TRUE(motor.is_off());
  motor.complete_tick(0);
  motor.complete_tick(-1);
  EXPECT_FALSE(motor.is_off()) << "after a tick of 0 there is no other";
  EXPECT_TRUE(chip.level(kDirection));
}

TEST_F(MotorOnChip, InterruptTurnsItOffFiftyMillisecondsAfterTheLastTick) {
  Motor motor{{.pwm_pin = kPin}};
  motor.begin();
  motor.complete_tick(1);
  EXPECT_GT(high_us(48'000), 47'000U);
  chip.pass(2'000);
  EXPECT_FALSE(chip.level(kPin)) << "50 ms after the tick";
  EXPECT_EQ(high_us(200'000'000), 0U) << "also when the cycle counter has come round";
  EXPECT_TRUE(motor.is_off());
  EXPECT_EQ(motor.dead_man_trips(), 1U);
}

TEST_F(MotorOnChip, TheCoreKnowsWhenTheInterruptTurnsItOff) {
  EXPECT_FLOAT_EQ(static_cast<float>(kDeadManUs) * 1e-6F, kMotorOffS);
}

TEST_F(MotorOnChip, StaysOffUntilATickCompletes) {
  Motor motor{{.pwm_pin = kPin}};
  motor.begin();
  motor.complete_tick(1);
  chip.pass(60'000);
  motor.follow(1);
  EXPECT_EQ(high_us(100'000), 0U) << "between ticks nothing turns it on";
  motor.complete_tick(0.5F);
  EXPECT_NEAR(static_cast<double>(high_us(10'000)), 5'000, 500);
}

TEST_F(MotorOnChip, StopBetweenTicksActsAtOnce) {
  Motor motor{{.pwm_pin = kPin}};
  motor.begin();
  motor.complete_tick(1);
  chip.pass(3'333);
  ASSERT_TRUE(chip.level(kPin));
  motor.follow(0);
  EXPECT_FALSE(chip.level(kPin));
  EXPECT_EQ(high_us(40'000), 0U);
}

TEST_F(MotorOnChip, BeginsLowWhateverAResetLeft) {
  chip.pins[kPin].latch = chip.pins[kDirection].latch = true;
  Motor motor{{.pwm_pin = kPin, .direction_pin = kDirection}};
  motor.begin();
  EXPECT_TRUE(chip.pins[kPin].output);
  EXPECT_EQ(chip.pins[kPin].rises, 0);
  EXPECT_EQ(chip.pins[kDirection].rises, 0);
  EXPECT_EQ(high_us(100'000), 0U);
}

}  // namespace
}  // namespace robot_fw::esp8266
