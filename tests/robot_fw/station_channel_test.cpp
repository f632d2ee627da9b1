// What a robot's channel to the station keeps, refuses and sends, without a robot.
#include "robot_fw/core/station_channel.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <vector>

namespace robot_fw {
namespace {

constexpr std::uint32_t kSamplesPerFrame = 5;

// A channel with its input and output, without a robot behind it.
class StationChannelTest : public ::testing::Test {
 protected:
  using State = protocol::FrameReader::State;

  static protocol::Welcome welcome(std::uint64_t durable_next_seq = 0) {
    protocol::Welcome welcome = rheonaut_Welcome_init_zero;
    welcome.protocol_version = protocol::kProtocolVersion;
    welcome.durable_next_seq = durable_next_seq;
    return welcome;
  }
  void connect(std::uint64_t durable_next_seq = 0) {
    channel.opened(now_us);
    ASSERT_TRUE(channel.accept(welcome(durable_next_seq), 1'000, now_us));
    channel.resume(welcome(durable_next_seq));
  }
  void make_samples(int count) {
    for (int i = 0; i < count; ++i) {
      now_us += 10'000;
      channel.push(Sample{}, BatchValues{}, false, now_us, 10'000);
    }
  }
  void make_event() {
    protocol::Event event = rheonaut_Event_init_zero;
    event.kind = rheonaut_EVENT_KIND_BOOT;
    channel.push(event);
  }
  // All that is due, in order.
  std::vector<Outgoing> sent() {
    std::vector<Outgoing> all;
    for (auto what = channel.next(now_us); what != Outgoing::none; what = channel.next(now_us)) {
      frame = rheonaut_RobotFrame_init_zero;
      channel.fill(what, frame);
      const bool is_telemetry = frame.which_body == rheonaut_RobotFrame_telemetry_tag;
      channel.sent(what, is_telemetry ? frame.body.telemetry.position_m_count : 0, now_us);
      all.push_back(what);
    }
    return all;
  }

  StationChannel channel{kSamplesPerFrame};
  protocol::RobotFrame frame{};  // that was sent last
  std::uint64_t now_us = 1'000'000;
};

TEST_F(StationChannelTest, SaysNothingButHelloBeforeItsWelcome) {
  make_event();
  EXPECT_EQ(channel.next(now_us), Outgoing::none);
  channel.opened(now_us);
  EXPECT_EQ(sent(), std::vector{Outgoing::hello});
  EXPECT_EQ(channel.link().phase(), Link::Phase::greeting);
}

TEST_F(StationChannelTest, KeepsWhyItWasRefusedUntilTheNextConnection) {
  channel.opened(now_us);
  auto refusal = welcome();
  refusal.refusal = rheonaut_REFUSAL_REASON_WRONG_TOKEN;
  std::strcpy(refusal.detail, "enrol it anew");
  EXPECT_FALSE(channel.accept(refusal, 1'000, now_us));
  EXPECT_EQ(channel.refusal(), rheonaut_REFUSAL_REASON_WRONG_TOKEN);
  EXPECT_STREQ(channel.refusal_detail(), "enrol it anew");
  EXPECT_FALSE(channel.link().up());
  channel.opened(now_us);
  EXPECT_EQ(channel.refusal(), rheonaut_REFUSAL_REASON_NONE);
  EXPECT_STREQ(channel.refusal_detail(), "");
}

TEST_F(StationChannelTest, RefusesAnotherVersion) {
  channel.opened(now_us);
  auto other = welcome();
  other.protocol_version += 1;
  EXPECT_FALSE(channel.accept(other, 1'000, now_us));
  EXPECT_EQ(channel.refusal(), rheonaut_REFUSAL_REASON_VERSION);
}

TEST_F(StationChannelTest, SendsAnEventAndTheSampleAfterItAtOnce) {
  connect();
  sent();
  make_event();
  make_samples(1);
  EXPECT_EQ(sent(), (std::vector{Outgoing::event, Outgoing::live}));
}

TEST_F(StationChannelTest, FillsAFrameWithAllThatItsSamplesAre) {
  connect();
  sent();
  BatchValues values;
  values.mode = rheonaut_MODE_AUTO;
  values.sub_state = rheonaut_SUB_STATE_NONE;
  values.has_setpoint = true;
  values.setpoint_m = 0.1F;
  values.disturbance_m = 0.02F;
  values.position_sd_m = 0.003F;
  values.controller_id = 4;
  values.emergency_id = 99;
  values.emergency_cause = rheonaut_EMERGENCY_CAUSE_OPERATOR;
  values.flags = rheonaut_TELEMETRY_FLAG_MODEL_CONFIRMED;
  const std::uint64_t first_us = now_us + 10'000;
  for (std::uint32_t i = 0; i < kSamplesPerFrame; ++i) {
    const auto n = static_cast<float>(i);
    now_us += 10'000;
    channel.push(Sample{n, n + 0.1F, n + 0.2F, n + 0.3F, n + 0.4F, n + 0.5F}, values, i == 2, now_us, 10'000);
  }
  ASSERT_EQ(sent(), std::vector{Outgoing::live});
  ASSERT_EQ(frame.which_body, rheonaut_RobotFrame_telemetry_tag);
  const protocol::Telemetry& batch = frame.body.telemetry;
  EXPECT_EQ(batch.first_seq, 0U);
  EXPECT_EQ(batch.oldest_seq, 0U);
  EXPECT_EQ(batch.first_robot_time_us, first_us);
  EXPECT_EQ(batch.period_us, 10'000U);
  EXPECT_EQ(batch.mode, rheonaut_MODE_AUTO);
  EXPECT_TRUE(batch.has_setpoint_m);
  EXPECT_EQ(batch.setpoint_m, 0.1F);
  EXPECT_EQ(batch.disturbance_m, 0.02F);
  EXPECT_EQ(batch.position_sd_m, 0.003F);
  EXPECT_EQ(batch.controller_id, 4U);
  EXPECT_EQ(batch.emergency_id, 99U);
  EXPECT_EQ(batch.emergency_cause, rheonaut_EMERGENCY_CAUSE_OPERATOR);
  EXPECT_EQ(batch.flags, rheonaut_TELEMETRY_FLAG_MODEL_CONFIRMED | rheonaut_TELEMETRY_FLAG_SATURATED);
  for (const pb_size_t count : {batch.position_m_count, batch.velocity_m_s_count, batch.acceleration_m_s2_count,
                                batch.duty_count, batch.impedance_mv_count, batch.reference_m_count}) {
    ASSERT_EQ(count, kSamplesPerFrame);
  }
  for (std::uint32_t i = 0; i < kSamplesPerFrame; ++i) {
    const auto n = static_cast<float>(i);
    EXPECT_EQ(batch.position_m[i], n);
    EXPECT_EQ(batch.velocity_m_s[i], n + 0.1F);
    EXPECT_EQ(batch.acceleration_m_s2[i], n + 0.2F);
    EXPECT_EQ(batch.duty[i], n + 0.3F);
    EXPECT_EQ(batch.impedance_mv[i], n + 0.4F);
    EXPECT_EQ(batch.reference_m[i], n + 0.5F);
  }
}

TEST_F(StationChannelTest, FillsTheLargestBatchIntoOneFrame) {
  channel.opened(now_us);
  auto asks_for_more = welcome();
  asks_for_more.samples_per_frame = 1'000;
  ASSERT_TRUE(channel.accept(asks_for_more, 1'000, now_us));
  channel.resume(asks_for_more);
  sent();
  make_samples(protocol::kMaxSamplesPerFrame);
  ASSERT_EQ(sent(), std::vector{Outgoing::live});
  EXPECT_EQ(frame.body.telemetry.position_m_count, protocol::kMaxSamplesPerFrame);
  std::array<std::uint8_t, protocol::kMaxFramedBytes> bytes{};
  EXPECT_GT(protocol::write_frame(frame, bytes.data(), bytes.size()), 0U);
}

TEST_F(StationChannelTest, FillsAnAnswerAndAnEvent) {
  connect();
  sent();
  protocol::CommandAck ack = rheonaut_CommandAck_init_zero;
  ack.command_id = 5;
  ack.result = rheonaut_COMMAND_RESULT_REJECTED;
  ack.reason = rheonaut_REJECT_REASON_MOTOR_ON;
  ack.emergency_id = 99;
  ack.effect_at_robot_us = now_us;
  channel.outbox().ack(ack);
  ASSERT_EQ(sent(), std::vector{Outgoing::ack});
  ASSERT_EQ(frame.which_body, rheonaut_RobotFrame_command_ack_tag);
  EXPECT_EQ(frame.body.command_ack.command_id, 5U);
  EXPECT_EQ(frame.body.command_ack.result, rheonaut_COMMAND_RESULT_REJECTED);
  EXPECT_EQ(frame.body.command_ack.reason, rheonaut_REJECT_REASON_MOTOR_ON);
  EXPECT_EQ(frame.body.command_ack.emergency_id, 99U);
  EXPECT_EQ(frame.body.command_ack.effect_at_robot_us, now_us);
  make_event();
  ASSERT_EQ(sent(), std::vector{Outgoing::event});
  ASSERT_EQ(frame.which_body, rheonaut_RobotFrame_event_tag);
  EXPECT_EQ(frame.body.event.kind, rheonaut_EVENT_KIND_BOOT);
}

TEST_F(StationChannelTest, InAHurryTheNextSampleLeavesAtOnceWithAllBeforeIt) {
  connect();
  make_samples(kSamplesPerFrame);
  sent();
  make_samples(2);
  EXPECT_EQ(sent(), std::vector<Outgoing>{}) << "a batch waits until it is complete";
  channel.hurry();
  EXPECT_EQ(sent(), std::vector<Outgoing>{}) << "the sample has to be made first";
  make_samples(1);
  ASSERT_EQ(sent(), std::vector{Outgoing::live});
  EXPECT_EQ(frame.body.telemetry.first_seq, kSamplesPerFrame);
  EXPECT_EQ(frame.body.telemetry.position_m_count, 3U);
  make_samples(1);
  EXPECT_EQ(sent(), std::vector<Outgoing>{}) << "for one sample only";
}

TEST_F(StationChannelTest, SendsAgainWhatTheStationLacks) {
  make_samples(8);
  connect(3);
  EXPECT_EQ(channel.samples().oldest_seq(), 3U);
  make_samples(3);  // a backfill waits for ticks
  sent();
  EXPECT_EQ(channel.outbox().backfill().next_seq, 8U);
  EXPECT_EQ(frame.body.telemetry.first_seq, 3U);
  EXPECT_TRUE(frame.body.telemetry.flags & rheonaut_TELEMETRY_FLAG_BACKFILL);
}

TEST_F(StationChannelTest, ForgetsWhatAHeartbeatSaysIsOnDiskAndAnswersItsProbe) {
  connect();
  make_samples(10);
  make_event();
  sent();
  protocol::StationHeartbeat heartbeat = rheonaut_StationHeartbeat_init_zero;
  heartbeat.durable_next_seq = 6;
  heartbeat.durable_next_event_seq = 1;
  heartbeat.station_time_us = 77;
  channel.on_heartbeat(heartbeat, now_us);
  EXPECT_EQ(channel.samples().oldest_seq(), 6U);
  EXPECT_EQ(channel.events().oldest_seq(), 1U);
  EXPECT_EQ(sent(), std::vector{Outgoing::heartbeat});
  EXPECT_EQ(frame.body.heartbeat.echo_station_time_us, 77U);
  EXPECT_EQ(frame.body.heartbeat.echo_received_at_robot_us, now_us);
}

TEST_F(StationChannelTest, CountsCommandsAndFramesThatAreNone) {
  channel.opened(now_us);
  protocol::StationFrame command = rheonaut_StationFrame_init_zero;
  command.which_body = rheonaut_StationFrame_command_tag;
  command.body.command.which_action = rheonaut_Command_ping_tag;
  command.body.command.command_id = 5;
  std::array<std::uint8_t, protocol::kMaxFramedBytes> bytes{};
  const std::size_t size = protocol::write_frame(command, bytes.data(), bytes.size());
  protocol::Bytes input{bytes.data(), size};
  ASSERT_EQ(channel.push(input), State::complete);
  const auto decoded = channel.frame();
  ASSERT_TRUE(decoded);
  EXPECT_EQ(decoded->body.command.command_id, 5U);
  EXPECT_EQ(channel.commands_received(), 1U);
  EXPECT_EQ(channel.bad_frames(), 0U);

  const std::array<std::uint8_t, 2> garbage{1, 0xFF};
  input = {garbage.data(), garbage.size()};
  ASSERT_EQ(channel.push(input), State::complete);
  EXPECT_FALSE(channel.frame());
  EXPECT_EQ(channel.bad_frames(), 1U);
  const std::array<std::uint8_t, 2> too_long{0xFF, 0x7F};
  input = {too_long.data(), too_long.size()};
  EXPECT_EQ(channel.push(input), State::oversize);
  EXPECT_EQ(channel.bad_frames(), 2U);
  EXPECT_EQ(channel.commands_received(), 1U);
}

TEST_F(StationChannelTest, FindsSilenceOnceAndSaysHowLongItWas) {
  connect();
  EXPECT_FALSE(channel.frame_received(now_us));
  EXPECT_FALSE(channel.goes_lost(now_us + 1'000'000));
  EXPECT_TRUE(channel.goes_lost(now_us + 1'000'001));
  EXPECT_FALSE(channel.goes_lost(now_us + 1'000'002));
  const auto silence_s = channel.frame_received(now_us + 2'000'000);
  ASSERT_TRUE(silence_s);
  EXPECT_FLOAT_EQ(*silence_s, 2.0F);
}

}  // namespace
}  // namespace robot_fw
