// What counts as evidence for each kind of command, and what does not.
#include "server/station/commands/telemetry_verifier.hpp"

#include <gtest/gtest.h>

#include "server/station/state/stop_times.hpp"

namespace server {
namespace {

constexpr std::uint64_t kEffectUs = 1'000'000;

station::SampleBatch batch_at(std::uint64_t first_us, std::size_t count) {
  station::SampleBatch batch;
  batch.first_robot_time_us = first_us;
  batch.context.period_us = 10'000;
  batch.context.mode = rheonaut_MODE_MANUAL;
  batch.samples.resize(count);
  return batch;
}

protocol::Command command_of(pb_size_t tag) {
  protocol::Command command = rheonaut_Command_init_zero;
  command.which_action = tag;
  return command;
}

TEST(TelemetryVerifier, AStopNeedsTheLatchAndDutyZero) {
  const auto stop = command_of(rheonaut_Command_emergency_stop_tag);
  station::SampleBatch batch = batch_at(kEffectUs, 2);
  EXPECT_EQ(look_for(stop, kEffectUs, 9, batch), station::Sight::unseen) << "not latched";
  batch.context.emergency_id = 9;
  EXPECT_EQ(look_for(stop, kEffectUs, 9, batch), station::Sight::seen);
  batch.samples[0].duty = batch.samples[1].duty = 0.1F;
  EXPECT_EQ(look_for(stop, kEffectUs, 9, batch), station::Sight::unseen) << "the motor runs";
  batch.context.emergency_id = 10;
  batch.samples[1].duty = 0;
  EXPECT_EQ(look_for(stop, kEffectUs, 9, batch), station::Sight::seen) << "a later stop shows the earlier one too";
}

TEST(TelemetryVerifier, OnlySamplesFromTheEffectOnCount) {
  auto duty = command_of(rheonaut_Command_set_duty_tag);
  duty.action.set_duty.duty = 0.3F;
  station::SampleBatch batch = batch_at(kEffectUs - 15'000, 3);  // the last one is made 5 ms after it
  batch.samples[0].duty = batch.samples[1].duty = 0.3F;
  EXPECT_EQ(look_for(duty, kEffectUs, 0, batch), station::Sight::unseen);
  batch.samples[2].duty = 0.3F;
  EXPECT_EQ(look_for(duty, kEffectUs, 0, batch), station::Sight::seen);
  EXPECT_EQ(look_for(duty, kEffectUs + 5'000, 0, batch), station::Sight::seen);
  EXPECT_EQ(look_for(duty, kEffectUs + 5'001, 0, batch), station::Sight::unseen);
}

TEST(TelemetryVerifier, TheWindowIsInTheRobotsTime) {
  auto duty = command_of(rheonaut_Command_set_duty_tag);
  duty.action.set_duty.duty = 0.3F;
  EXPECT_EQ(look_for(duty, kEffectUs, 0, batch_at(kEffectUs + station::kVerifyWindowUs - 1, 1)),
            station::Sight::unseen);
  EXPECT_EQ(look_for(duty, kEffectUs, 0, batch_at(kEffectUs + station::kVerifyWindowUs, 1)), station::Sight::missed);
}

TEST(TelemetryVerifier, ModeAndSetpointMustBeTheOnesOrdered) {
  auto mode = command_of(rheonaut_Command_set_mode_tag);
  mode.action.set_mode.mode = rheonaut_MODE_AUTO;
  mode.action.set_mode.has_setpoint_m = true;
  mode.action.set_mode.setpoint_m = 0.1F;
  auto setpoint = command_of(rheonaut_Command_set_setpoint_tag);
  setpoint.action.set_setpoint.setpoint_m = 0.1F;
  station::SampleBatch batch = batch_at(kEffectUs, 1);
  batch.context.setpoint_m = 0.1F;
  EXPECT_EQ(look_for(mode, kEffectUs, 0, batch), station::Sight::unseen);
  EXPECT_EQ(look_for(setpoint, kEffectUs, 0, batch), station::Sight::unseen);
  batch.context.mode = rheonaut_MODE_AUTO;
  EXPECT_EQ(look_for(mode, kEffectUs, 0, batch), station::Sight::seen);
  EXPECT_EQ(look_for(setpoint, kEffectUs, 0, batch), station::Sight::seen);
  batch.context.setpoint_m = 0.2F;
  EXPECT_EQ(look_for(mode, kEffectUs, 0, batch), station::Sight::unseen);
  EXPECT_EQ(look_for(setpoint, kEffectUs, 0, batch), station::Sight::unseen);
}

TEST(TelemetryVerifier, AClearIsSeenWhenTheLatchIsGone) {
  const auto clear = command_of(rheonaut_Command_clear_emergency_tag);
  station::SampleBatch batch = batch_at(kEffectUs, 1);
  EXPECT_EQ(look_for(clear, kEffectUs, 0, batch), station::Sight::seen);
  batch.context.emergency_id = 12;
  EXPECT_EQ(look_for(clear, kEffectUs, 0, batch), station::Sight::overtaken) << "a new emergency";
}

TEST(TelemetryVerifier, KindsThatNoSampleShowsAreKnown) {
  for (const int tag : {rheonaut_Command_renew_lease_tag, rheonaut_Command_ping_tag, rheonaut_Command_zero_position_tag,
                        rheonaut_Command_drop_timed_tag}) {
    EXPECT_FALSE(station::can_be_seen(command_of(static_cast<pb_size_t>(tag))));
    EXPECT_EQ(look_for(command_of(static_cast<pb_size_t>(tag)), kEffectUs, 0, batch_at(kEffectUs, 1)),
              station::Sight::unseen);
  }
}

TEST(StopTimes, CountsByUpperBound) {
  runtime::TimeHistogram times;
  for (const std::int64_t time_us : {0, 50, 51, 1'000'000, 1'000'001}) times.add(time_us);
  EXPECT_EQ(times.counts().front(), 2u);
  EXPECT_EQ(times.counts()[1], 1u);
  EXPECT_EQ(times.counts()[13], 1u);
  EXPECT_EQ(times.counts().back(), 1u);
  EXPECT_EQ(times.sum(), 2'000'102);
}

}  // namespace
}  // namespace server
