// The link: hello first, signs of life, loss by silence, and what the robot does then.
#include <cstring>

#include "tests/robot_fw/driven_robot.hpp"

namespace robot_fw {
namespace {

using namespace sim_robot;
using RobotLink = DrivenRobot;

protocol::StationFrame welcome_frame() {
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_welcome_tag;
  frame.body.welcome.protocol_version = protocol::kProtocolVersion;
  return frame;
}

TEST(Hello, IsTheFirstFrameAndTheOnlyOneBeforeWelcome) {
  SimulatedRobotConfig config;
  config.robot_id = "swimmer-1";
  config.token = "secret";
  config.boot_id = 0x1234;
  SimulatedRobot robot{config};
  StationPeer station{robot};
  station.run(30);
  robot.link_opened(robot.robot_time_us());
  for (int i = 0; i < 50; ++i) {
    station.listen();
    robot.step();
  }
  ASSERT_EQ(station.frames.size(), 1u);
  ASSERT_TRUE(station.hello.has_value());
  EXPECT_STREQ(station.hello->robot_id, "swimmer-1");
  EXPECT_STREQ(station.hello->token, "secret");
  EXPECT_EQ(station.hello->boot_id, 0x1234u);
  EXPECT_EQ(station.hello->protocol_version, 1u);
  EXPECT_EQ(station.hello->next_seq, 30u);
  EXPECT_EQ(station.hello->ring_capacity, 800u);
  EXPECT_EQ(station.hello->mode, rheonaut_MODE_MANUAL);
}

TEST(Hello, GetsTheConnectionClosedByARefusalOfAnyReason) {
  for (const auto reason :
       {rheonaut_REFUSAL_REASON_VERSION, rheonaut_REFUSAL_REASON_UNKNOWN_ROBOT, rheonaut_REFUSAL_REASON_WRONG_TOKEN,
        rheonaut_REFUSAL_REASON_ALREADY_CONNECTED, rheonaut_REFUSAL_REASON_BOOT_ID_REUSED,
        rheonaut_REFUSAL_REASON_MALFORMED, rheonaut_REFUSAL_REASON_STATION_BUSY}) {
    SimulatedRobot robot{{}};
    StationPeer station{robot};
    robot.link_opened(0);
    protocol::StationFrame frame = welcome_frame();
    frame.body.welcome.refusal = reason;
    std::strcpy(frame.body.welcome.detail, "enrol it anew");
    EXPECT_FALSE(station.send(frame));
    EXPECT_EQ(robot.core().refusal(), reason);
    EXPECT_STREQ(robot.core().refusal_detail(), "enrol it anew");
    EXPECT_FALSE(robot.core().link_up());

    robot.link_closed(0);  // the next connection starts anew
    robot.link_opened(0);
    EXPECT_EQ(robot.core().refusal(), rheonaut_REFUSAL_REASON_NONE);
    EXPECT_TRUE(station.send(welcome_frame()));
    EXPECT_TRUE(robot.core().link_up());
  }
}

TEST(Hello, KeepsTheBeginningOfALongRefusalAndCutsNoCharacter) {
  SimulatedRobot robot{{}};
  StationPeer station{robot};
  robot.link_opened(0);
  protocol::StationFrame frame = welcome_frame();
  frame.body.welcome.refusal = rheonaut_REFUSAL_REASON_WRONG_TOKEN;
  const std::string beginning(62, 'a');
  std::strcpy(frame.body.welcome.detail, (beginning + "€ and more").c_str());
  EXPECT_FALSE(station.send(frame));
  EXPECT_EQ(robot.core().refusal_detail(), beginning);
}

TEST(Hello, RefusesAStationOfAnotherVersion) {
  SimulatedRobot robot{{}};
  StationPeer station{robot};
  robot.link_opened(0);
  protocol::StationFrame frame = welcome_frame();
  frame.body.welcome.protocol_version = 2;
  EXPECT_FALSE(station.send(frame));
  EXPECT_EQ(robot.core().refusal(), rheonaut_REFUSAL_REASON_VERSION);
}

TEST(Hello, ANewConnectionForgetsHalfAFrameOfTheOldOne) {
  SimulatedRobot robot{{}};
  StationPeer station{robot};
  robot.link_opened(0);
  const std::uint8_t half[] = {0x20, 0x01};
  EXPECT_TRUE(robot.receive({half, 2}, 0));
  robot.link_closed(0);
  station.connect();
  EXPECT_TRUE(robot.core().link_up());
}

TEST_F(RobotLink, ClosesOnASecondWelcomeAndOnCommandsBeforeTheFirst) {
  EXPECT_FALSE(station.send(welcome_frame()));
  robot.link_opened(robot.robot_time_us());
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_heartbeat_tag;
  EXPECT_FALSE(station.send(frame));
}

TEST_F(RobotLink, ClosesAndCountsOnWhatIsNoFrame) {
  const std::uint8_t oversize[] = {0xFF, 0x7F};
  EXPECT_FALSE(robot.receive({oversize, 2}, robot.robot_time_us()));
  station.disconnect();
  station.connect();
  const std::uint8_t garbage[] = {2, 0xFF, 0xFF};
  EXPECT_FALSE(robot.receive({garbage, 3}, robot.robot_time_us()));
  station.disconnect();
  station.connect();
  station.run(100);
  const protocol::RobotFrame* status = nullptr;
  for (const auto& frame : station.frames) {
    if (frame.which_body == rheonaut_RobotFrame_status_tag) status = &frame;
  }
  ASSERT_NE(status, nullptr);
  EXPECT_EQ(status->body.status.bad_frames, 2u);
}

TEST_F(RobotLink, IsLostAfterOneSecondOfSilenceAndStopsAuto) {
  order(set_auto(0.1F));
  station.attentive = false;
  station.run(99);
  EXPECT_EQ(mode(), "auto");
  station.run(3);
  EXPECT_TRUE(core().link_lost());
  EXPECT_EQ(core().duty(), 0);
  expect_at_rest();
  EXPECT_NE(last().flags & rheonaut_TELEMETRY_FLAG_LINK_LOSS, 0u);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_LINK_LOST), 1);
}

TEST_F(RobotLink, IsRestoredByAnyFrameAndNothingMovesByItself) {
  order(set_auto(0.1F));
  station.attentive = false;
  station.run(150);
  station.attentive = true;
  station.run(2);
  EXPECT_FALSE(core().link_lost());
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_LINK_RESTORED), 1);
  EXPECT_NEAR(station.events.back().value, 1.5, 0.05);
  expect_at_rest();
}

TEST_F(RobotLink, LossDropsTimedCommands) {
  protocol::Command later = set_auto(0.1F);
  later.has_execute_at_robot_us = true;
  later.execute_at_robot_us = robot.robot_time_us() + 150 * kTickUs;
  order(later);
  station.attentive = false;
  station.run(120);
  station.attentive = true;
  station.run(40);
  expect_at_rest();
}

TEST_F(RobotLink, OutlivesAConnectionWithinTheTimeOut) {
  order(set_auto(0.1F));
  station.disconnect();
  station.run(80);
  station.connect();
  station.run(80);
  EXPECT_EQ(mode(), "auto");
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_LINK_LOST), 0);
}

TEST_F(RobotLink, OfARobotThatNeverHadOneIsNotLost) {
  SimulatedRobot alone{{}};
  for (int i = 0; i < 500; ++i) alone.step();
  EXPECT_FALSE(alone.core().link_lost());
}

TEST_F(RobotLink, TakesItsTimeOutFromWelcomeWithinBounds) {
  station.disconnect();
  station.welcome.link_timeout_ms = 300;
  station.connect();
  station.attentive = false;
  station.run(32);
  EXPECT_TRUE(core().link_lost());

  station.disconnect();
  station.welcome.link_timeout_ms = 4'000'000;
  station.connect();
  station.run(502);
  EXPECT_TRUE(core().link_lost());
}

TEST_F(RobotLink, AnswersAStampedHeartbeat) {
  protocol::StationHeartbeat probe = rheonaut_StationHeartbeat_init_zero;
  probe.station_time_us = 86'400'000'000;
  station.send_heartbeat(probe);
  const std::uint64_t received_at_us = robot.robot_time_us();
  station.step();
  int answers = 0;
  for (const auto& frame : station.frames) {
    if (frame.which_body != rheonaut_RobotFrame_heartbeat_tag) continue;
    if (frame.body.heartbeat.echo_station_time_us == 0) continue;
    EXPECT_EQ(frame.body.heartbeat.echo_station_time_us, probe.station_time_us);
    EXPECT_EQ(frame.body.heartbeat.echo_received_at_robot_us, received_at_us);
    EXPECT_GE(frame.robot_time_us, received_at_us);
    ++answers;
  }
  EXPECT_EQ(answers, 1);
}

TEST_F(RobotLink, AnswersOnlyTheLatestOfTwoStampsAndNoneWithout) {
  protocol::StationHeartbeat probe = rheonaut_StationHeartbeat_init_zero;
  for (const std::uint64_t stamp_us : {5'000U, 6'000U, 0U}) {
    probe.station_time_us = stamp_us;
    station.send_heartbeat(probe);
  }
  station.frames.clear();
  station.run(100);
  std::vector<std::uint64_t> echoes;
  for (const auto& frame : station.frames) {
    const bool heartbeat = frame.which_body == rheonaut_RobotFrame_heartbeat_tag;
    if (heartbeat) echoes.push_back(frame.body.heartbeat.echo_station_time_us);
  }
  EXPECT_EQ(echoes, std::vector<std::uint64_t>{6'000U});
}

TEST_F(RobotLink, SendsAHeartbeatOnlyWhenNothingElseWasSent) {
  station.disconnect();
  station.welcome.samples_per_frame = 25;  // a frame every 250 ms
  station.connect();
  station.run(50);
  station.frames.clear();
  station.run(100);
  int heartbeats = 0;
  std::uint64_t before_us = station.frames.front().robot_time_us;
  for (const auto& frame : station.frames) {
    heartbeats += frame.which_body == rheonaut_RobotFrame_heartbeat_tag;
    EXPECT_LE(frame.robot_time_us - before_us, 210'000u);
    before_us = frame.robot_time_us;
  }
  EXPECT_GE(heartbeats, 2);
  EXPECT_LE(heartbeats, 4);
}

TEST_F(RobotLink, SaysWhenTheConnectionIsSilent) {
  EXPECT_FALSE(core().connection_is_silent(robot.robot_time_us()));
  station.attentive = false;
  station.run(102);
  EXPECT_TRUE(core().connection_is_silent(robot.robot_time_us()));
  station.disconnect();
  EXPECT_FALSE(core().connection_is_silent(robot.robot_time_us()));
  station.connect();
  EXPECT_FALSE(core().connection_is_silent(robot.robot_time_us()));
}

// SAFETY: nobody ordered anything: what runs goes on, what lapses lapses, and the robot's memory of ids stays.
TEST_F(RobotLink, AStopProbeIsAnsweredInEachModeAndDoesNothing) {
  protocol::StationFrame probe = rheonaut_StationFrame_init_zero;
  probe.which_body = rheonaut_StationFrame_stop_probe_tag;
  std::uint64_t stamp_us = 0;
  const auto is_answered = [&] {
    probe.body.stop_probe.station_time_us = ++stamp_us;
    station.frames.clear();
    EXPECT_TRUE(station.send(probe));
    station.listen();  // within the tick in which it came
    if (station.frames.empty() || station.frames[0].which_body != rheonaut_RobotFrame_stop_probe_answer_tag)
      return false;
    return station.frames[0].body.stop_probe_answer.echo_station_time_us == stamp_us;
  };
  EXPECT_TRUE(is_answered());
  const std::size_t events = station.events.size();
  protocol::Command duty = set_duty(0.2F);
  duty.command_id = 4711;
  ASSERT_EQ(answer(duty), "accepted");
  for (int i = 0; i < 100; ++i) {
    EXPECT_TRUE(is_answered());
    station.step();
  }
  EXPECT_EQ(core().duty(), 0) << "the lease of 500 ms has lapsed: a probe extends none";
  EXPECT_EQ(answer(duty), "duplicate") << "100 probes are no commands: the id is still remembered";
  ASSERT_EQ(answer(set_auto(0.05F)), "accepted");
  EXPECT_TRUE(is_answered());
  station.run(5);
  EXPECT_EQ(mode(), "auto");
  ASSERT_EQ(answer(emergency_stop()), "accepted");
  const std::uint64_t latch = core().emergency_id();
  EXPECT_TRUE(is_answered());
  station.run(5);
  EXPECT_EQ(mode(), "emergency");
  EXPECT_EQ(core().emergency_id(), latch);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_EMERGENCY), 1);
  EXPECT_GT(station.events.size(), events);
}

TEST_F(RobotLink, TheHelloSaysThatStopProbesAreAnswered) { EXPECT_TRUE(station.hello->answers_stop_probes); }

}  // namespace
}  // namespace robot_fw
