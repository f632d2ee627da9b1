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
  EXPECT_FALSE(channel.heard(now_us));
  EXPECT_FALSE(channel.goes_lost(now_us + 1'000'000));
  EXPECT_TRUE(channel.goes_lost(now_us + 1'000'001));
  EXPECT_FALSE(channel.goes_lost(now_us + 1'000'002));
  const auto silence_s = channel.heard(now_us + 2'000'000);
  ASSERT_TRUE(silence_s);
  EXPECT_FLOAT_EQ(*silence_s, 2.0F);
}

}  // namespace
}  // namespace robot_fw
