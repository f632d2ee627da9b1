// How a robot is welcomed, refused and lost.
#include "tests/server/link/link_fixture.hpp"

namespace server {
namespace {

TEST_F(LinkTest, WelcomesARobotAndSendsItWhatIsDurable) {
  archive.answer.store_id = 5;
  archive.answer.durable_next_seq = 120;
  archive.answer.durable_next_event_seq = 3;
  auto* robot = connect();
  ASSERT_EQ(robot->welcomes().size(), 1u);
  const auto welcome = robot->welcomes()[0];
  EXPECT_EQ(welcome.refusal, rheonaut_REFUSAL_REASON_NONE);
  EXPECT_EQ(welcome.store_id, 5u);
  EXPECT_EQ(welcome.durable_next_seq, 120u);
  EXPECT_EQ(welcome.durable_next_event_seq, 3u);
  EXPECT_EQ(welcome.link_timeout_ms, 1000u);
  EXPECT_TRUE(connected());
  ASSERT_EQ(archive.requests.size(), 1u);
  EXPECT_EQ(archive.requests[0].robot_id, "r1");
  EXPECT_TRUE(archive.requests[0].from_loopback);
}

TEST_F(LinkTest, TheArchiveLearnsHowFarTheBootWasAcknowledgedByAnyStation) {
  auto* robot = dial();
  auto hello = TestRobot::hello_frame();
  hello.body.hello.acknowledged_next_seq = 7;
  hello.body.hello.acknowledged_next_event_seq = 3;
  robot->send(hello);
  ASSERT_TRUE(clock.run_until([&] { return !archive.requests.empty(); }, 1s));
  EXPECT_EQ(archive.requests[0].acknowledged_next_seq, 7U);
  EXPECT_EQ(archive.requests[0].acknowledged_next_event_seq, 3U);
}

TEST_F(LinkTest, RefusesAnotherProtocolVersionWithTheReason) {
  auto* robot = dial();
  auto hello = TestRobot::hello_frame();
  hello.body.hello.protocol_version = 2;
  robot->send(hello);
  ASSERT_TRUE(clock.run_until([&] { return robot->closed; }, 1s));
  ASSERT_EQ(robot->welcomes().size(), 1u);
  EXPECT_EQ(robot->welcomes()[0].refusal, rheonaut_REFUSAL_REASON_VERSION);
  EXPECT_FALSE(connected());
}

TEST_F(LinkTest, RefusesWhatTheArchiveRefuses) {
  archive.answer.refusal = rheonaut_REFUSAL_REASON_WRONG_TOKEN;
  archive.answer.detail = "the token of 'r1' is another one";
  auto* robot = dial();
  robot->say_hello();
  ASSERT_TRUE(clock.run_until([&] { return robot->closed; }, 1s));
  EXPECT_EQ(robot->welcomes()[0].refusal, rheonaut_REFUSAL_REASON_WRONG_TOKEN);
  EXPECT_STREQ(robot->welcomes()[0].detail, "the token of 'r1' is another one");
}

TEST_F(LinkTest, ARobotThatCannotEnrolItselfIsAnEventUnderItsNameAtMostOnceIn10S) {
  archive.answer.refusal = rheonaut_REFUSAL_REASON_UNKNOWN_ROBOT;
  archive.answer.enrolment_full = true;
  archive.answer.detail = "64 robots have enrolled themselves";
  const auto ask = [this](char number) {
    auto frame = TestRobot::hello_frame();
    frame.body.hello.robot_id[1] = number;
    auto* robot = dial();
    robot->send(frame);
    EXPECT_TRUE(clock.run_until([&] { return robot->closed; }, 1s));
  };
  for (const char number : {'2', '3', '4'}) ask(number);
  ASSERT_EQ(sink.events.size(), 1u);
  EXPECT_EQ(sink.events[0].kind, "enrolment_refused");
  EXPECT_EQ(sink.events[0].robot_id, "r2");
  EXPECT_NE(sink.events[0].detail.find("64 robots have enrolled themselves"), std::string::npos);
  clock.run_for(11s);
  ask('5');
  ASSERT_EQ(sink.events.size(), 2u);
  EXPECT_NE(sink.events[1].detail.find("(2 more since the last event)"), std::string::npos) << sink.events[1].detail;
  EXPECT_EQ(station.find("r2"), nullptr) << "it is not listed";
}

TEST_F(LinkTest, RefusesAMalformedHello) {
  const auto spoil = [](auto change) {
    auto frame = TestRobot::hello_frame();
    change(frame.body.hello);
    return frame;
  };
  for (const auto& frame :
       {spoil([](auto& hello) { hello.robot_id[0] = 'R'; }), spoil([](auto& hello) { hello.robot_id[0] = '\0'; }),
        spoil([](auto& hello) { hello.boot_id = 0; }), spoil([](auto& hello) { hello.oldest_seq = 10; }),
        spoil([](auto& hello) { hello.next_seq = ~std::uint64_t{0}; })}) {
    auto* robot = dial();
    robot->send(frame);
    ASSERT_TRUE(clock.run_until([&] { return robot->closed; }, 1s));
    EXPECT_EQ(robot->welcomes().at(0).refusal, rheonaut_REFUSAL_REASON_MALFORMED);
  }
}

TEST_F(LinkTest, RefusesAHelloWithATextThatIsTooLong) {
  std::vector<std::uint8_t> bytes{36, 0x12, 34, 0x12, 32};  // hello of 34 bytes: robot_id of 32
  bytes.insert(bytes.end(), 32, 'r');
  auto* robot = dial();
  robot->send_bytes(bytes);
  ASSERT_TRUE(clock.run_until([&] { return robot->closed; }, 1s));
  ASSERT_EQ(robot->welcomes().size(), 1u);
  EXPECT_EQ(robot->welcomes()[0].refusal, rheonaut_REFUSAL_REASON_MALFORMED);
  EXPECT_NE(std::string{robot->welcomes()[0].detail}.find("robot_id has at most 31"), std::string::npos);
  EXPECT_TRUE(archive.requests.empty());
}

TEST_F(LinkTest, ClosesOnGarbageOversizeAndAnythingButHello) {
  auto* garbage = dial();
  garbage->send_bytes({5, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF});
  auto* oversize = dial();
  oversize->send_bytes({0xFF, 0x7F});
  auto* impolite = dial();
  auto frame = TestRobot::hello_frame();
  frame.which_body = rheonaut_RobotFrame_status_tag;
  impolite->send(frame);
  EXPECT_TRUE(clock.run_until([&] { return garbage->closed && oversize->closed && impolite->closed; }, 100ms));
  EXPECT_TRUE(garbage->frames.empty() && oversize->frames.empty() && impolite->frames.empty());
}

TEST_F(LinkTest, ClosesAConnectionThatSaysNothing) {
  auto* robot = dial();
  EXPECT_FALSE(clock.run_until([&] { return robot->closed; }, 4900ms));
  EXPECT_TRUE(clock.run_until([&] { return robot->closed; }, 200ms));
}

// Its robot would send it again over the next connection, and the one after.
TEST_F(LinkTest, AFrameThatDoesNotDecodeIsPassedOverAndCounted) {
  auto* robot = connect();
  for (int i = 0; i < 3; ++i) robot->send_bytes({3, 0xFF, 0xFF, 0xFF});
  robot->send_samples(0, 5, 6'000'000, 0);
  clock.run_for(2s);
  EXPECT_FALSE(robot->closed);
  ASSERT_EQ(sink.batches.size(), 1u);
  EXPECT_EQ(station.find("r1")->invalid_values, 3u);
  EXPECT_EQ(sink.events.back().kind, "invalid_value");
  EXPECT_EQ(sink.events.back().cause, "malformed");
}

TEST_F(LinkTest, DeclaresAHalfOpenLinkLostAfterTheTimeout) {
  auto* robot = connect();
  clock.run_for(1s);
  ASSERT_TRUE(connected());
  robot->link.stall(true);
  const auto stalled_at_us = clock.steady_us();
  ASSERT_TRUE(clock.run_until([&] { return !connected(); }, 2s));
  EXPECT_LE(clock.steady_us() - stalled_at_us, 1'200'000);
  EXPECT_EQ(sink.events.back().detail, "no frame within the link time-out");
}

TEST_F(LinkTest, DropsARobotThatTalksButDoesNotRead) {
  auto* robot = dial(64);
  robot->say_hello();
  ASSERT_TRUE(clock.run_until([&] { return !robot->welcomes().empty(); }, 1s));
  robot->keep_talking();
  robot->reading = false;
  ASSERT_TRUE(clock.run_until([&] { return !connected(); }, 10s));
  EXPECT_EQ(sink.events.back().detail, "the robot does not read");
}

TEST_F(LinkTest, SendsASignOfLifeEvery200ms) {
  auto* robot = connect();
  const std::size_t before = robot->heartbeats().size();
  clock.run_for(2s);
  EXPECT_NEAR(static_cast<double>(robot->heartbeats().size() - before), 10, 1);
}

TEST_F(LinkTest, TheSameBootTakesThePlaceOfItsOldConnection) {
  auto* old_connection = connect();
  auto* new_connection = dial();
  new_connection->say_hello();
  ASSERT_TRUE(clock.run_until([&] { return old_connection->closed; }, 1s));
  EXPECT_TRUE(connected());
  EXPECT_FALSE(new_connection->closed);
}

TEST_F(LinkTest, AnotherBootIsRefusedUntilTheFirstWasSilent) {
  auto* first = connect();
  auto hello = TestRobot::hello_frame();
  hello.body.hello.boot_id = 78;
  auto* second = dial();
  second->send(hello);
  ASSERT_TRUE(clock.run_until([&] { return second->closed; }, 1s));
  EXPECT_EQ(second->welcomes().at(0).refusal, rheonaut_REFUSAL_REASON_ALREADY_CONNECTED);
  EXPECT_TRUE(connected());
  first->link.stall(true);
  clock.run_for(1100ms);
  auto* third = dial();
  third->send(hello);
  ASSERT_TRUE(clock.run_until([&] { return !third->welcomes().empty(); }, 100ms));
  EXPECT_EQ(third->welcomes()[0].refusal, rheonaut_REFUSAL_REASON_NONE);
  EXPECT_EQ(station.find("r1")->boot_id, 78u);
}

// An event names both addresses, whichever of the two connections wins; a robot that dials again and again, refused
// each time, makes one in ten seconds.
TEST_F(LinkTest, ARefusedSecondConnectionIsAnEventThatNamesBoth) {
  connect();
  const std::string first_peer = station.find("r1")->peer;
  const auto refusals = [this] {
    std::vector<station::RobotEvent> found;
    for (const station::RobotEvent& event : sink.events) {
      if (event.kind == "connection_refused") found.push_back(event);
    }
    return found;
  };
  auto hello = TestRobot::hello_frame();
  hello.body.hello.boot_id = 78;
  const auto dial_again = [&] {
    auto* second = dial();
    second->send(hello);
    return clock.run_until([&] { return second->closed; }, 1s);
  };
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(dial_again());
  ASSERT_EQ(refusals().size(), 1u);
  const std::string cause = refusals()[0].detail;
  EXPECT_TRUE(cause.starts_with("memory refused, already_connected: ")) << cause;
  EXPECT_NE(cause.find("is connected from " + first_peer + " with boot 77"), std::string::npos) << cause;
  EXPECT_EQ(refusals()[0].robot_id, "r1");
  clock.run_for(10s);
  ASSERT_TRUE(dial_again());
  ASSERT_EQ(refusals().size(), 2u);
  EXPECT_NE(refusals()[1].detail.find("(4 more since the last event)"), std::string::npos) << refusals()[1].detail;
}

TEST_F(LinkTest, ARefusedTokenIsAnEventOfARobotThatIsKnown) {
  connect();
  archive.answer.refusal = rheonaut_REFUSAL_REASON_WRONG_TOKEN;
  archive.answer.detail = "the token of 'r1' is another one";
  auto* impostor = dial();
  impostor->say_hello();
  ASSERT_TRUE(clock.run_until([&] { return impostor->closed; }, 1s));
  ASSERT_EQ(sink.events.back().kind, "connection_refused");
  EXPECT_NE(sink.events.back().detail.find("wrong_token: the token of 'r1' is another one"), std::string::npos);
  const std::size_t before = sink.events.size();
  auto* unauthenticated = dial();
  auto hello = TestRobot::hello_frame();
  hello.body.hello.robot_id[1] = '9';
  unauthenticated->send(hello);
  ASSERT_TRUE(clock.run_until([&] { return unauthenticated->closed; }, 1s));
  EXPECT_EQ(sink.events.size(), before) << "an unauthenticated robot's name makes no record";
  EXPECT_TRUE(connected());
}

TEST_F(LinkTest, TheStationEndsAConnectionWhoseEnrolmentIsRevoked) {
  auto* robot = connect();
  station.end_connection("r1", "its enrolment was revoked");
  ASSERT_TRUE(clock.run_until([&] { return robot->closed; }, 1s));
  EXPECT_FALSE(connected());
  EXPECT_EQ(sink.events.back().kind, "disconnected");
  EXPECT_EQ(sink.events.back().detail, "its enrolment was revoked");
  station.end_connection("nobody", "x");
}

TEST_F(LinkTest, SamplesReachTheSinksWithTheirContext) {
  auto* robot = connect();
  robot->send_samples(0, 5, robot->robot_now_us(), 0);
  ASSERT_TRUE(clock.run_until([&] { return !sink.batches.empty(); }, 100ms));
  const station::SampleBatch& batch = sink.batches[0];
  EXPECT_EQ(batch.robot_id, "r1");
  EXPECT_EQ(batch.boot_id, 77u);
  EXPECT_EQ(batch.next_seq(), 5u);
  EXPECT_EQ(batch.samples[4].position_m, 4.0F);
  EXPECT_EQ(batch.context.mode, rheonaut_MODE_MANUAL);
  EXPECT_EQ(station.find("r1")->next_seq, 5u);
  EXPECT_EQ(station.find("r1")->sample->position_m, 4.0F);
}

TEST_F(LinkTest, SamplesSentAgainDoNotChangeTheLiveState) {
  auto* robot = connect();
  robot->send_samples(100, 5, robot->robot_now_us(), 0);
  robot->send_samples(10, 5, robot->robot_now_us() - 900'000, 0);
  ASSERT_TRUE(clock.run_until([&] { return sink.batches.size() == 2; }, 100ms));
  EXPECT_EQ(station.find("r1")->next_seq, 105u);
  EXPECT_EQ(station.find("r1")->sample->position_m, 104.0F);
}

TEST_F(LinkTest, SendsTheRobotWhatIsDurableAndWhatToSendAgain) {
  auto* robot = connect();
  station.on_durable("r1", 77, 40, 2);
  station.request_resend("r1", 77, 40, 60);
  clock.settle();
  const auto last = robot->heartbeats().back();
  EXPECT_EQ(last.durable_next_seq, 40u);
  EXPECT_EQ(last.durable_next_event_seq, 2u);
  EXPECT_EQ(last.resend_first_seq, 40u);
  EXPECT_EQ(last.resend_next_seq, 60u);
  EXPECT_FALSE(last.resend_events);
  clock.run_for(300ms);
  EXPECT_EQ(robot->heartbeats().back().resend_next_seq, 0u) << "asked once";
}

TEST_F(LinkTest, AsksTheRobotOnceToSendItsEventsAgain) {
  auto* robot = connect();
  station.request_event_resend("r1", 76);  // an earlier boot
  clock.settle();
  EXPECT_FALSE(robot->heartbeats().back().resend_events);
  station.request_event_resend("r1", 77);
  clock.settle();
  EXPECT_TRUE(robot->heartbeats().back().resend_events);
  clock.run_for(300ms);
  EXPECT_FALSE(robot->heartbeats().back().resend_events);
}

TEST_F(LinkTest, AnswersOfTheRobotGiveTheClockOffset) {
  auto* robot = connect();
  const auto probe = robot->heartbeats().back();
  ASSERT_NE(probe.station_time_us, 0u);
  clock.run_for(20ms);
  protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
  frame.which_body = rheonaut_RobotFrame_heartbeat_tag;
  frame.body.heartbeat.echo_station_time_us = probe.station_time_us;
  frame.body.heartbeat.echo_received_at_robot_us = robot->robot_now_us() - 10'000;
  robot->send(frame);
  clock.settle();
  const station::ClockEstimate estimate = station.find("r1")->clock;
  ASSERT_TRUE(estimate.valid);
  EXPECT_LE(std::abs(estimate.offset_us - robot->booted_at_us), estimate.uncertainty_us(robot->robot_now_us()));
  EXPECT_LE(estimate.uncertainty_us(robot->robot_now_us()), 15'000);
}

TEST_F(LinkTest, AnAnswerToNoProbeOfOursDoesNotMoveTheClock) {
  auto* robot = connect();
  protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
  frame.which_body = rheonaut_RobotFrame_heartbeat_tag;
  frame.body.heartbeat.echo_station_time_us = 12345;
  frame.body.heartbeat.echo_received_at_robot_us = 5'000'000;
  robot->send(frame);
  clock.settle();
  EXPECT_FALSE(station.find("r1")->clock.valid);
}

TEST_F(LinkTest, TheOldestSilentConnectionGivesWayAndARobotNever) {
  auto* robot = connect();
  std::vector<TestRobot*> silent;
  for (std::size_t i = 0; i < kPlaces.unauthenticated + 20; ++i) {
    silent.push_back(dial());
    clock.settle();
  }
  EXPECT_TRUE(silent[19]->closed);
  EXPECT_FALSE(silent[20]->closed);
  EXPECT_EQ(access.limiter.counters().replaced, 20U);
  EXPECT_FALSE(robot->closed);
  clock.run_for(6s);  // the silent ones are gone
  EXPECT_EQ(access.limiter.connections(), 1U);
  EXPECT_TRUE(connected());
}

TEST_F(LinkTest, ARobotGetsInThroughACrowdOfSilentConnectionsAndIsStopped) {
  for (std::size_t i = 0; i < kPlaces.unauthenticated; ++i) dial();
  clock.settle();
  auto* robot = connect();
  for (int i = 0; i < 50; ++i) dial();
  clock.settle();
  ASSERT_TRUE(connected());
  stop_robot();
  clock.settle();
  EXPECT_EQ(robot->commands().size(), 1U);
}

}  // namespace
}  // namespace server
