// The way to the station: what is set before the handshake, when it may happen, and how frames leave.
#include "robot_fw/esp8266/station_link.hpp"

#include "board_fixture.hpp"

namespace robot_fw::esp8266 {
namespace {

class Link : public BoardFixture {
 protected:
  // Opens, and is welcomed with this batch.
  void connect_with(std::uint32_t samples_per_frame) {
    boot();
    for (int i = 0; i < 100 && board->link().state() != StationLink::State::open; ++i) run_ms(100);
    protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
    frame.which_body = rheonaut_StationFrame_welcome_tag;
    frame.body.welcome.protocol_version = protocol::kProtocolVersion;
    frame.body.welcome.samples_per_frame = samples_per_frame;
    say(frame);
  }
  void ping() {
    protocol::Command ping = rheonaut_Command_init_zero;
    ping.which_action = rheonaut_Command_ping_tag;
    order(ping);
  }
};

TEST_F(Link, PinsTheKeyAndAsksForShortRecords) {
  connect();
  EXPECT_EQ(chip.socket.known_key, kStationKey);
  EXPECT_EQ(chip.socket.receive_bytes, 512);
  EXPECT_EQ(chip.socket.send_bytes, 512);
  EXPECT_GT(chip.socket.ciphers, 0);
  EXPECT_TRUE(chip.socket.no_delay);
}

// A turn may wait for TCP three times, each up to twice the time-out, and a tick may have been due for a period.
TEST_F(Link, TimeoutsOfATurnAreShorterThanTheMotors) {
  connect_with(25);
  const std::uint64_t expected_us = 3 * 2 * chip.socket.timeout_ms * 1000;
  EXPECT_LT(expected_us, kDeadManUs - kTickUs);
  chip.socket.takes = false;
  std::uint64_t longest_us = 0;
  const int dials = chip.socket.dials;
  while (chip.now_us < 8'000'000 && board->link().state() == StationLink::State::open && chip.socket.dials == dials) {
    chip.pass(kTurnUs);
    const std::uint64_t before_us = chip.now_us;
    board->step();
    const bool is_the_same = board->link().state() == StationLink::State::open && chip.socket.dials == dials;
    if (is_the_same) longest_us = std::max(longest_us, chip.now_us - before_us);
  }
  EXPECT_GT(longest_us, 0U);
  EXPECT_LE(longest_us, expected_us);
}

TEST_F(Link, KeyThatIsNoneIsShownAndNobodyIsDialled) {
  Secrets secrets = kTestSecrets;
  secrets.station_key_pem = "MFkwEwYHKoZIzj0CAQYIKoZIzj0DAQcDQgAE";
  board.emplace(secrets);
  board->begin();
  run_ms(10'000);
  EXPECT_EQ(board->led_pattern(), LedPattern::refused);
  EXPECT_EQ(chip.joins, 0);
  EXPECT_EQ(chip.socket.dials, 0);
  board.reset();  // before the secrets
}

TEST_F(Link, NetworkIsNeverKeptInFlashNorRejoinedBehindOurBack) {
  boot();
  EXPECT_FALSE(chip.wifi_persistent);
  EXPECT_FALSE(chip.wifi_reconnects);
  EXPECT_FALSE(chip.wifi_sleeps);
}

TEST_F(Link, StationThatDoesNotAgreeOnShortRecordsIsLeft) {
  chip.socket.agrees_on_fragments = false;
  boot();
  run_ms(6'000);
  EXPECT_GT(chip.socket.dials, 0);
  EXPECT_NE(board->link().state(), StationLink::State::open);
  EXPECT_TRUE(chip.socket.writes.empty());
}

// Whether the station refuses, or is not there at all: 6 s are less than the ring holds.
TEST_F(Link, AttemptsFollowWithinASecondWhileTheRingHasRoom) {
  for (const bool refuses : {true, false}) {
    connect();
    Socket& socket = chip.socket;
    socket.attempt_began_us.clear();
    socket.attempt_failed_us.clear();
    socket.refuses = refuses;
    socket.answers = refuses;
    socket.connected = false;
    run_ms(6'000);
    ASSERT_GE(socket.attempt_failed_us.size(), 2U);
    for (std::size_t i = 1; i < socket.attempt_began_us.size(); ++i) {
      EXPECT_LE(socket.attempt_began_us[i] - socket.attempt_failed_us[i - 1], 1'000'000U) << "refuses: " << refuses;
    }
    EXPECT_LT(board->robot().samples().fill(), TelemetryRing::kCapacity);
    new_chip();
  }
}

TEST_F(Link, AttemptWithoutAnAnswerEndsAfterTwoSecondsWithTheMotorOff) {
  for (const bool knows_name : {true, false}) {
    connect();
    Socket& socket = chip.socket;
    socket.attempt_began_us.clear();
    socket.attempt_failed_us.clear();
    drive(0.5F);
    chip.before_blocking = [this] { EXPECT_TRUE(board->motor().is_off()); };
    socket.knows_name = knows_name;
    socket.answers = false;
    socket.connected = false;
    run_ms(6'000);
    ASSERT_GE(socket.attempt_failed_us.size(), 2U);
    for (std::size_t i = 0; i < socket.attempt_failed_us.size(); ++i) {
      EXPECT_LE(socket.attempt_failed_us[i] - socket.attempt_began_us[i], 2'000'000U) << "knows name: " << knows_name;
    }
    new_chip();
  }
}

TEST_F(Link, HandshakeOfFiveSecondsIsWaitedForAndOneWithoutEndIsNot) {
  chip.socket.handshake_takes_us = 5'000'000;
  connect();
  chip.socket.handshake_takes_us = 60'000'000;
  chip.socket.connected = false;
  run_ms(3'000);
  ASSERT_GE(chip.socket.attempt_failed_us.size(), 1U);
  EXPECT_LE(chip.socket.attempt_failed_us[0] - chip.socket.attempt_began_us[1], 8'000'000U);
}

TEST_F(Link, PausesGrowOnceTheRingIsFull) {
  chip.socket.refuses = true;
  boot();
  run_ms(20'000);
  ASSERT_EQ(board->robot().samples().fill(), TelemetryRing::kCapacity);
  const int dials = chip.socket.dials;
  EXPECT_GE(dials, 15);
  run_ms(60'000);
  EXPECT_LE(chip.socket.dials - dials, 60 / 1);
  EXPECT_GE(chip.socket.dials - dials, 60 / 6);
}

TEST_F(Link, WithoutWifiItJoinsAgainAndAgain) {
  chip.wifi_there = false;
  boot();
  run_ms(60'000);
  EXPECT_GE(chip.joins, 2);
  EXPECT_EQ(chip.socket.dials, 0);
  chip.wifi_there = true;
  come_up();
}

// A lost link while the motor is on: no joining, no dialling, no closing until it is off.
TEST_F(Link, NeverDialsWithTheMotorOn) {
  connect();
  for (int i = 0; i < 10; ++i) {
    drive(0.5F);
    run_ms(80);
  }
  chip.before_blocking = [this] {
    EXPECT_TRUE(board->motor().is_off());
    EXPECT_TRUE(board->robot().at_rest());
    EXPECT_FALSE(chip.level(kMotorPin));
  };
  const int dials = chip.socket.dials;
  chip.socket.connected = false;
  run_ms(100);
  EXPECT_NE(board->link().state(), StationLink::State::open);
  EXPECT_FALSE(board->motor().is_off()) << "the lease still runs";
  EXPECT_EQ(chip.socket.dials, dials);
  run_ms(5'000);
  EXPECT_TRUE(board->motor().is_off());
  EXPECT_GT(chip.socket.dials, dials);
}

TEST_F(Link, NeverDialsInAutoEvenAtDutyZero) {
  connect();
  wait_for_sensors();
  order(sim_robot::set_auto(-0.1F));  // behind it, and the motor has no reverse
  run_ms(20);
  ASSERT_EQ(board->robot().mode(), rheonaut_MODE_AUTO);
  ASSERT_TRUE(board->motor().is_off());
  const int dials = chip.socket.dials;
  chip.socket.connected = false;
  chip.before_blocking = [this] { EXPECT_NE(board->robot().mode(), rheonaut_MODE_AUTO); };
  run_ms(900);
  EXPECT_EQ(board->robot().mode(), rheonaut_MODE_AUTO) << "within the link time-out";
  EXPECT_EQ(chip.socket.dials, dials);
  run_ms(5'000);
  EXPECT_GT(chip.socket.dials, dials);
}

TEST_F(Link, NeverRejoinsWithTheMotorOn) {
  connect();
  drive(0.5F);
  chip.before_blocking = [this] { EXPECT_TRUE(board->motor().is_off()); };
  const int joins = chip.joins;
  chip.wifi_begun = false;
  run_ms(200);
  EXPECT_EQ(board->link().state(), StationLink::State::off);
  EXPECT_EQ(chip.joins, joins);
  run_ms(3'000);
  EXPECT_GT(chip.joins, joins);
}

TEST_F(Link, WritesNeverWaitForThePeer) {
  connect();
  run_ms(500);
  EXPECT_GT(chip.socket.writes.size(), 5U);
  EXPECT_EQ(chip.socket.waiting_flushes, 0);
}

TEST_F(Link, FrameThatDoesNotFitWaitsAndThenGoesInOneWrite) {
  connect();
  chip.socket.room = 100;
  run_ms(20);
  received();
  const std::uint64_t before_us = chip.now_us;
  run_ms(400);
  EXPECT_EQ(chip.now_us - before_us, 400'000U) << "no tick waited";
  for (const protocol::RobotFrame& frame : received()) EXPECT_NE(frame.which_body, rheonaut_RobotFrame_telemetry_tag);
  chip.socket.room = 1072;
  run_ms(100);
  std::size_t samples = 0;
  for (const protocol::RobotFrame& frame : received()) {
    if (frame.which_body == rheonaut_RobotFrame_telemetry_tag) samples += frame.body.telemetry.position_m_count;
  }
  EXPECT_GE(samples, 40U);
}

TEST_F(Link, StopsWritingWhenNothingIsAcknowledged) {
  connect();
  chip.socket.acknowledges = false;
  const std::uint64_t before_us = chip.now_us;
  const std::size_t writes = chip.socket.writes.size();
  run_ms(900);
  EXPECT_EQ(chip.now_us - before_us, 900'000U) << "no write waited";
  EXPECT_LE(chip.socket.writes.size() - writes, 6U) << "no more pieces than TCP has places for";
  EXPECT_GT(chip.socket.writes.size() - writes, 0U);
}

// Small frames fill lwIP's queue of 8 pieces long before its buffer.
TEST_F(Link, CountsSmallFramesUnderWay) {
  connect();
  chip.socket.acknowledges = false;
  const std::size_t writes = chip.socket.writes.size();
  for (int i = 0; i < 12; ++i) ping();
  run_ms(30);
  EXPECT_GT(chip.socket.room, 400U);
  EXPECT_LE(chip.socket.writes.size() - writes, 6U);
  EXPECT_GE(chip.socket.writes.size() - writes, 4U);
}

TEST_F(Link, LargestFrameFitsAnEmptySendBuffer) {
  connect_with(25);
  run_ms(1'000);
  std::size_t largest = 0;
  for (const protocol::RobotFrame& sent : received()) {
    if (sent.which_body == rheonaut_RobotFrame_telemetry_tag) {
      largest = std::max<std::size_t>(largest, sent.body.telemetry.position_m_count);
    }
  }
  EXPECT_EQ(largest, 25U);
}

// While input waits, looking for more does not send.
TEST_F(Link, LastRecordLeavesAlsoWhileInputWaits) {
  connect();
  const std::size_t writes = chip.socket.writes.size();
  for (int i = 0; i < 100; ++i) ping();  // more than a turn reads
  for (int turn = 0; turn < 5; ++turn) {
    chip.pass(kTurnUs);
    board->step();
    ASSERT_TRUE(chip.socket.input_is_found);
    EXPECT_EQ(chip.socket.sealed, 0U) << "turn " << turn;
  }
  EXPECT_GT(chip.socket.writes.size(), writes);
}

TEST_F(Link, NoFrameFollowsARecordThatTlsStillHolds) {
  connect();
  chip.socket.takes = false;
  const std::size_t writes = chip.socket.writes.size();
  const std::uint64_t until_us = chip.now_us + 300'000;
  while (chip.now_us < until_us) run_ms(1);
  ASSERT_EQ(board->link().state(), StationLink::State::open);
  EXPECT_EQ(chip.socket.writes.size(), writes + 1);
  EXPECT_GT(chip.socket.sealed, 0U);
  chip.socket.takes = true;
  run_ms(200);
  EXPECT_EQ(chip.socket.sealed, 0U);
  EXPECT_GT(chip.socket.writes.size(), writes + 1);
}

TEST_F(Link, SilentStationIsDialledAgain) {
  connect();
  run_ms(6'000);
  EXPECT_GE(chip.socket.dials, 2);
  EXPECT_GE(chip.socket.closes, 1);
}

}  // namespace
}  // namespace robot_fw::esp8266
