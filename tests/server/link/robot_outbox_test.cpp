// What is sent to a robot, and in which order, shown by the bytes alone.
#include "server/link/robot_outbox.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

namespace server {
namespace {

constexpr std::int64_t kIntervalUs = 250'000;
constexpr std::int64_t kLater = std::numeric_limits<std::int64_t>::max() / 2;

protocol::Command command(station::CommandId id, pb_size_t action = rheonaut_Command_ping_tag) {
  protocol::Command command = rheonaut_Command_init_zero;
  command.command_id = id;
  command.which_action = action;
  return command;
}

// An outbox and the other end of its stream, which cuts frames from what it is given.
class RobotOutboxTest : public ::testing::Test {
 protected:
  using Words = std::vector<std::string>;

  void receive(protocol::Bytes bytes) {
    while (!bytes.empty()) {
      if (reader_.push(bytes) != protocol::FrameReader::State::complete) continue;
      const auto frame = protocol::decode_station_frame(reader_.payload());
      ASSERT_TRUE(frame);
      frames.push_back(*frame);
    }
  }
  static std::string word(const protocol::StationFrame& frame) {
    if (frame.which_body == rheonaut_StationFrame_welcome_tag) return "welcome";
    if (frame.which_body == rheonaut_StationFrame_heartbeat_tag) return "heartbeat";
    if (frame.which_body == rheonaut_StationFrame_stop_probe_tag) return "probe";
    const bool is_stop = frame.body.command.which_action == rheonaut_Command_emergency_stop_tag;
    return (is_stop ? "stop " : "command ") + std::to_string(frame.body.command.command_id);
  }
  // Writes all that is due, and says what it was.
  Words written() {
    frames.clear();
    const auto write = [this](protocol::Bytes bytes) {
      receive(bytes);
      return bytes.size;
    };
    while (outbox.write_next(now_us, write)) {
    }
    Words words;
    for (const auto& frame : frames) words.push_back(word(frame));
    return words;
  }
  void stop(station::CommandId id) { outbox.enqueue_stop(command(id, rheonaut_Command_emergency_stop_tag)); }
  void answer(station::CommandId id) {
    protocol::CommandAck ack = rheonaut_CommandAck_init_zero;
    ack.command_id = id;
    outbox.on_ack(ack);
  }

  link::RobotOutbox outbox{kIntervalUs};
  std::int64_t now_us = 10'000'000;
  std::vector<protocol::StationFrame> frames;

 private:
  protocol::FrameReader reader_;
};

TEST_F(RobotOutboxTest, WelcomeThenStopsThenCommandsThenAHeartbeat) {
  stop(9);
  outbox.enqueue(command(1), kLater);
  outbox.enqueue(command(2), kLater);
  protocol::Welcome welcome = rheonaut_Welcome_init_zero;
  welcome.durable_next_seq = 40;
  outbox.welcome(welcome);
  EXPECT_EQ(written(), (Words{"welcome", "stop 9", "command 1", "command 2", "heartbeat"}));
  EXPECT_EQ(frames.back().body.heartbeat.durable_next_seq, 40U);
  EXPECT_EQ(written(), Words{});
}

// SAFETY: a stop is ahead of what waits and drops it.
TEST_F(RobotOutboxTest, AStopDropsWhatIsQueued) {
  written();
  outbox.enqueue(command(1), kLater);
  stop(9);
  EXPECT_FALSE(outbox.withdraw(1));
  outbox.enqueue(command(2), kLater);
  EXPECT_EQ(written(), (Words{"stop 9", "command 2"}));
}

TEST_F(RobotOutboxTest, OfTooManyStopsTheOldestMakesRoom) {
  written();
  for (station::CommandId id = 1; id <= link::RobotOutbox::kMaxQueuedStops + 1; ++id) stop(id);
  const Words words = written();
  ASSERT_EQ(words.size(), link::RobotOutbox::kMaxQueuedStops);
  EXPECT_EQ(words.front(), "stop 2");
  EXPECT_EQ(words.back(), "stop " + std::to_string(link::RobotOutbox::kMaxQueuedStops + 1));
}

TEST_F(RobotOutboxTest, AFullQueueRefusesUntilOneIsWithdrawn) {
  for (station::CommandId id = 1; id <= link::RobotOutbox::kMaxQueuedCommands; ++id)
    EXPECT_TRUE(outbox.enqueue(command(id), kLater));
  EXPECT_FALSE(outbox.enqueue(command(100), kLater));
  EXPECT_TRUE(outbox.withdraw(5));
  EXPECT_FALSE(outbox.withdraw(5));
  EXPECT_TRUE(outbox.enqueue(command(100), kLater));
}

// SAFETY: what waited longer than its validity is never sent.
TEST_F(RobotOutboxTest, WhatIsTooOldIsNotSent) {
  written();
  outbox.enqueue(command(1), now_us);
  outbox.enqueue(command(2), now_us + 1);
  EXPECT_EQ(written(), (Words{"command 2"}));
}

// SAFETY: a robot keeps no more answers than these; a stop asks for no place.
TEST_F(RobotOutboxTest, BeyondTheWindowCommandsWaitForAnswersAndStopsDoNot) {
  written();
  for (station::CommandId id = 1; id <= link::CommandWindow::kMost + 2; ++id) outbox.enqueue(command(id), kLater);
  EXPECT_EQ(written().size(), link::CommandWindow::kMost);
  answer(2);
  EXPECT_EQ(written(), (Words{"command 7"}));
  outbox.on_event_of(3);
  EXPECT_EQ(written(), (Words{"command 8"}));
  outbox.enqueue(command(20), kLater);
  stop(9);
  EXPECT_EQ(written(), (Words{"stop 9"}));
}

TEST_F(RobotOutboxTest, ATimedCommandHoldsItsPlaceUntilItsTimeHasPassed) {
  written();
  protocol::Command timed = command(1);
  timed.has_execute_at_robot_us = true;
  outbox.enqueue(timed, kLater);
  for (station::CommandId id = 2; id <= link::CommandWindow::kMost; ++id) outbox.enqueue(command(id), kLater);
  EXPECT_EQ(written().size(), link::CommandWindow::kMost - 1) << "it takes two places";
  protocol::CommandAck ack = rheonaut_CommandAck_init_zero;
  ack.command_id = 1;
  ack.result = rheonaut_COMMAND_RESULT_ACCEPTED;
  ack.effect_at_robot_us = 1'000'000;
  outbox.on_ack(ack);
  EXPECT_EQ(written().size(), 1U) << "then one";
  outbox.enqueue(command(30), kLater);
  outbox.on_robot_time(1'020'000, 10'000);
  EXPECT_EQ(written(), Words{});
  outbox.on_robot_time(1'020'001, 10'000);
  EXPECT_EQ(written(), (Words{"command 30"}));
}

TEST_F(RobotOutboxTest, HeartbeatsLeaveAtTheirIntervalOrALittleEarlyWithARobotsFrame) {
  written();
  EXPECT_EQ(outbox.next_heartbeat_us(), now_us + kIntervalUs);
  now_us += kIntervalUs - 20'001;
  outbox.on_received(now_us);
  EXPECT_FALSE(outbox.has_work());
  EXPECT_EQ(written(), Words{});
  now_us += 1;
  outbox.on_received(now_us);
  EXPECT_TRUE(outbox.has_work());
  EXPECT_EQ(written(), (Words{"heartbeat"}));
  now_us += kIntervalUs;
  EXPECT_EQ(written(), (Words{"heartbeat"}));
}

TEST_F(RobotOutboxTest, AResendIsAskedForOnceAndWhatIsDurableStays) {
  written();
  outbox.set_durable(70, 5);
  outbox.request_resend(60, 65);
  outbox.request_event_resend();
  EXPECT_EQ(written(), (Words{"heartbeat"}));
  const protocol::StationHeartbeat asked = frames.back().body.heartbeat;
  EXPECT_EQ(asked.durable_next_seq, 70U);
  EXPECT_EQ(asked.durable_next_event_seq, 5U);
  EXPECT_EQ(asked.resend_first_seq, 60U);
  EXPECT_EQ(asked.resend_next_seq, 65U);
  EXPECT_TRUE(asked.resend_events);
  now_us += kIntervalUs;
  written();
  const protocol::StationHeartbeat next = frames.back().body.heartbeat;
  EXPECT_EQ(next.durable_next_seq, 70U);
  EXPECT_EQ(next.resend_next_seq, 0U);
  EXPECT_FALSE(next.resend_events);
}

TEST_F(RobotOutboxTest, AnAnswerIsAwaitedFromStopsCommandsAndProbes) {
  written();
  const std::uint64_t probe_us = frames.back().body.heartbeat.station_time_us;
  EXPECT_EQ(probe_us, static_cast<std::uint64_t>(now_us));
  EXPECT_TRUE(outbox.awaits_answer());
  EXPECT_FALSE(outbox.on_probe_answer(probe_us - 1));
  EXPECT_FALSE(outbox.on_probe_answer(0));
  EXPECT_TRUE(outbox.on_probe_answer(probe_us));
  EXPECT_FALSE(outbox.on_probe_answer(probe_us)) << "twice";
  EXPECT_FALSE(outbox.awaits_answer());
  outbox.enqueue(command(1), kLater);
  stop(9);
  outbox.enqueue(command(2), kLater);
  written();
  answer(2);
  EXPECT_TRUE(outbox.awaits_answer()) << "of the stop";
  answer(9);
  EXPECT_FALSE(outbox.awaits_answer());
}

TEST_F(RobotOutboxTest, NothingFollowsAFrameWhoseRestIsUnsent) {
  outbox.enqueue(command(1), kLater);
  outbox.enqueue(command(2), kLater);
  const auto write_one = [this](protocol::Bytes bytes) {
    receive({bytes.first, 1});
    return std::size_t{1};
  };
  const auto first = outbox.write_next(now_us, write_one);
  ASSERT_TRUE(first);
  EXPECT_EQ(first->command_id, station::CommandId{1});
  stop(9);
  EXPECT_EQ(written(), Words{}) << "not even a stop, inside a frame";
  receive(outbox.unsent());
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_EQ(word(frames[0]), "command 1");
  outbox.unsent_was_written();
  EXPECT_EQ(written(), (Words{"stop 9", "heartbeat"}));
}

// SAFETY: it shows how long a stop would take, and delays none.
TEST_F(RobotOutboxTest, AStopProbeGoesBehindStopsAndBeforeAllElse) {
  outbox.stop_probes().begin(now_us);
  outbox.enqueue(command(1), kLater);
  stop(9);
  outbox.enqueue(command(2), kLater);
  EXPECT_EQ(written(), (Words{"stop 9", "probe", "command 2", "heartbeat"}));
}

TEST_F(RobotOutboxTest, AtMostTwoStopProbesASecondAnsweredOrNot) {
  outbox.stop_probes().begin(now_us);
  std::size_t probes = 0;
  for (const std::int64_t end_us = now_us + 10'000'000; now_us < end_us; now_us += 1000) {
    for (const std::string& word : written()) probes += word == "probe";
    if (now_us % 3'000'000 < 1000) outbox.stop_probes().on_answer(frames.empty() ? 0 : 1, now_us, 1);
  }
  EXPECT_EQ(probes, 20U);
}

TEST_F(RobotOutboxTest, ARobotThatAnswersNoStopProbesGetsNone) {
  written();
  now_us += 10'000'000;
  EXPECT_EQ(written(), Words{"heartbeat"});
}

}  // namespace
}  // namespace server
