// The abort criteria: each is met by what it is for, and by nothing just inside its bound.
#include "server/experiments/runner/abort_watch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace server::experiments {
namespace {

class AbortWatchTest : public ::testing::Test {
 protected:
  // 5 samples, 50 ms later than the last.
  void samples(float position_m, float duty = 0) {
    station::Sample sample;
    sample.position_m = position_m;
    sample.duty = duty;
    batch_.samples.assign(5, sample);
    batch_.first_seq = next_seq_;
    next_seq_ += 5;
    now_us_ += 50'000;
    watch().on_samples(batch_, now_us_);
  }
  AbortWatch& watch() {
    if (!watch_) watch_.emplace(criteria_, now_us_);
    return *watch_;
  }
  std::string reason() {
    const auto found = watch().fault() ? watch().fault() : watch().late(now_us_);
    return found ? found->reason : "";
  }

  AbortCriteria criteria_;
  station::SampleBatch batch_ = [] {
    station::SampleBatch batch;
    batch.robot_id = "r1";
    batch.boot_id = 7;
    return batch;
  }();
  std::uint64_t next_seq_ = 100;
  std::int64_t now_us_ = 1'000'000;
  std::optional<AbortWatch> watch_;
};

TEST_F(AbortWatchTest, APositionCountsWithTwoStandardDeviations) {
  criteria_.position_max_m = 0.2;
  criteria_.position_min_m = -0.2;
  batch_.context.position_sd_m = 0.04F;
  samples(0.11F);
  EXPECT_EQ(reason(), "");
  samples(0.13F);
  EXPECT_EQ(reason(), "position");
  watch_.reset();
  samples(-0.13F);
  EXPECT_EQ(reason(), "position");
}

TEST_F(AbortWatchTest, WhatWasMadeBeforeItIsNotOfTheRun) {
  criteria_.position_max_m = 0.2;
  batch_.context.flags = rheonaut_TELEMETRY_FLAG_BACKFILL;
  samples(0.3F);
  batch_.context.flags = 0;
  next_seq_ += 600;
  samples(0.1F);
  EXPECT_EQ(reason(), "");
}

TEST_F(AbortWatchTest, ADisturbanceIsNoPosition) {
  criteria_.position_max_m = 0.2;
  batch_.context.disturbance_m = 0.15F;
  samples(0.3F);
  EXPECT_EQ(reason(), "");
}

TEST_F(AbortWatchTest, WhatIsNoNumberIsBeyondEveryBound) {
  samples(std::numeric_limits<float>::quiet_NaN());
  EXPECT_EQ(reason(), "position");
  watch_.reset();
  batch_.context.position_sd_m = std::nullopt;
  samples(0);
  EXPECT_EQ(reason(), "position");
}

TEST_F(AbortWatchTest, AnUncertainPosition) {
  criteria_.position_sd_max_m = 0.05;
  batch_.context.position_sd_m = 0.05F * 0.99F;
  samples(0);
  EXPECT_EQ(reason(), "");
  batch_.context.position_sd_m = 0.051F;
  samples(0);
  EXPECT_EQ(reason(), "position_sd");
}

TEST_F(AbortWatchTest, TimeAtPowerIsWithoutABreak) {
  criteria_.power_s = 1;
  for (int i = 0; i < 19; ++i) samples(0, -0.95F);
  samples(0, 0.5F);
  for (int i = 0; i < 19; ++i) samples(0, 0.95F);
  EXPECT_EQ(reason(), "");
  samples(0, 0.95F);
  samples(0, 0.95F);
  EXPECT_EQ(reason(), "power");
}

TEST_F(AbortWatchTest, AGapInTime) {
  criteria_.gap_s = 0.5;
  samples(0);
  now_us_ += 500'000;
  EXPECT_EQ(reason(), "");
  now_us_ += 1;
  EXPECT_EQ(reason(), "gap");
}

TEST_F(AbortWatchTest, MissingSamplesCountUntilTheyCome) {
  criteria_.missing_share = 0.02;
  for (int i = 0; i < 200; ++i) samples(0);
  next_seq_ += 25;
  samples(0);
  EXPECT_EQ(reason(), "missing_samples") << "25 of 1000";
  station::SampleBatch late = batch_;
  late.first_seq = batch_.first_seq - 25;
  late.samples.assign(25, station::Sample{});
  watch().on_samples(late, now_us_);
  EXPECT_EQ(reason(), "") << "they were held back";
}

TEST_F(AbortWatchTest, ASensorFaultUnlessItIsAllowed) {
  batch_.context.flags = rheonaut_TELEMETRY_FLAG_SENSOR_FAULT;
  samples(0);
  EXPECT_EQ(reason(), "sensor_fault");
  watch_.reset();
  criteria_.sensor_fault = false;
  samples(0);
  EXPECT_EQ(reason(), "");
}

// SAFETY's test: what the robot took in and did not do ends the run; what only no sample has shown does not.
TEST(FaultOfACommand, IsWhatTheRobotDidNotDo) {
  using station::CommandState;
  station::CommandRecord record;
  record.kind = "set_setpoint";
  record.acknowledged_after_us = 2000;
  for (const CommandState state : {CommandState::rejected, CommandState::expired, CommandState::failed}) {
    record.state = state;
    EXPECT_EQ(fault_of(record)->reason, "command_refused") << text(state);
  }
  record.kind = "set_duty_schedule";
  record.state = CommandState::rejected;
  record.reason = "out_of_range";
  EXPECT_THAT(fault_of(record)->detail, ::testing::HasSubstr("runs one way only"));
  record.kind = "set_setpoint";
  record.state = CommandState::superseded;
  for (const char* reason : {"control_ended", "by_emergency_stop", "limits_changed"}) {
    record.reason = reason;
    EXPECT_TRUE(fault_of(record)) << reason;
  }
  record.reason = "by_a_newer_command";
  EXPECT_FALSE(fault_of(record));
  record.acknowledged_after_us = -1;
  EXPECT_TRUE(fault_of(record)) << "it never reached the robot";
  record.state = CommandState::verified;
  EXPECT_FALSE(fault_of(record));
}

TEST_F(AbortWatchTest, AnotherBoot) {
  samples(0);
  batch_.boot_id = 8;
  samples(0);
  EXPECT_EQ(reason(), "reboot");
}

}  // namespace
}  // namespace server::experiments
