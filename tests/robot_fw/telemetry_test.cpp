// Every sample reaches the station: batches, order of sending, backfill, resending, and the counting of losses.
#include <algorithm>

#include "tests/robot_fw/driven_robot.hpp"

namespace robot_fw {
namespace {

using namespace sim_robot;

class Telemetry : public DrivenRobot {
 protected:
  Telemetry() {
    station.disconnect();
    station.welcome.samples_per_frame = 5;
    station.connect();
    station.run(10);
    station.frames.clear();
  }
  std::uint64_t next_seq() const { return robot.robot_time_us() / kTickUs; }  // one sample a tick, from boot on
  std::vector<protocol::Telemetry> batches(bool backfill) const {
    std::vector<protocol::Telemetry> found;
    for (const auto& frame : station.frames) {
      if (frame.which_body != rheonaut_RobotFrame_telemetry_tag) continue;
      const protocol::Telemetry& batch = frame.body.telemetry;
      if (((batch.flags & rheonaut_TELEMETRY_FLAG_BACKFILL) != 0) == backfill) found.push_back(batch);
    }
    return found;
  }
  protocol::Status last_status() const {
    protocol::Status status = rheonaut_Status_init_zero;
    for (const auto& frame : station.frames) {
      if (frame.which_body == rheonaut_RobotFrame_status_tag) status = frame.body.status;
    }
    return status;
  }
  // Every sample from the first to the last received is there.
  void expect_no_hole() const {
    ASSERT_FALSE(station.samples.empty());
    EXPECT_EQ(station.samples.rbegin()->first + 1 - station.samples.begin()->first, station.samples.size());
  }
};

TEST_F(Telemetry, BringsFiveSamplesInAFrame) {
  station.run(100);
  for (const auto& batch : batches(false)) EXPECT_EQ(batch.position_m_count, 5);
  EXPECT_EQ(batches(false).size(), 20u);
  expect_no_hole();
}

TEST_F(Telemetry, BringsAsManySamplesInAFrameAsTheStationAsksFor) {
  for (const std::uint32_t preferred : {1U, 2U, 7U, 24U, 25U, 26U, UINT32_MAX}) {
    station.disconnect();
    station.welcome.samples_per_frame = preferred;
    station.connect();
    station.frames.clear();
    station.run(100);
    ASSERT_FALSE(batches(false).empty());
    for (const auto& batch : batches(false)) EXPECT_EQ(batch.position_m_count, std::min(preferred, 25U)) << preferred;
  }
  expect_no_hole();
}

TEST_F(Telemetry, WhatACommandChangesIsSentInThatTick) {
  station.run(2);
  const auto tick_seq = next_seq();
  order(set_auto(0.1F));
  EXPECT_EQ(station.samples.rbegin()->first, tick_seq);
  EXPECT_EQ(last().mode, rheonaut_MODE_AUTO);
  expect_no_hole();
  station.run(3);
  order(set_duty(0));  // refused: nothing changes, nothing is urgent
  EXPECT_LT(station.samples.rbegin()->first, next_seq() - 1);
}

TEST_F(Telemetry, BatchesNeverSpanAChange) {
  for (int i = 0; i < 50; ++i) {
    station.send(i % 3 == 0 ? set_auto(0.01F * static_cast<float>(i)) : i % 3 == 1 ? set_manual() : ping());
    station.run(1 + i % 7);
  }
  for (const auto& batch : batches(false)) {
    EXPECT_EQ(batch.has_setpoint_m, batch.mode == rheonaut_MODE_AUTO);
    for (pb_size_t i = 0; i < batch.position_m_count; ++i) {
      EXPECT_EQ(batch.reference_m[i], batch.has_setpoint_m ? batch.setpoint_m : 0);
    }
  }
  expect_no_hole();
}

TEST_F(Telemetry, AfterAReconnectTheRestOfTheRingIsSentAgainAndNothingIsMissing) {
  station.disconnect();
  station.run(300);
  station.connect();
  station.frames.clear();
  station.run(400);
  expect_no_hole();
  EXPECT_GE(station.samples.size(), 700u);
  EXPECT_FALSE(batches(true).empty());
}

TEST_F(Telemetry, LiveSamplesFlowFirstAndBackfillAtMostTwiceAsFast) {
  station.disconnect();
  station.run(600);
  const auto live_from = next_seq();
  station.connect();
  station.frames.clear();
  station.run(100);
  std::size_t live = 0, backfill = 0;
  for (const auto& batch : batches(false)) live += batch.position_m_count;
  for (const auto& batch : batches(true)) backfill += batch.position_m_count;
  EXPECT_GE(live, 95u);
  EXPECT_LE(backfill, 200u);
  EXPECT_GE(backfill, 150u);
  for (const auto& batch : batches(false)) EXPECT_GE(batch.first_seq, live_from);
}

TEST_F(Telemetry, SamplesAreSentAgainOnRequest) {
  station.keeps_samples = false;
  const auto first = next_seq();
  station.run(100);
  for (auto seq = first + 10; seq < first + 40; ++seq) station.samples.erase(seq);
  protocol::StationHeartbeat heartbeat = rheonaut_StationHeartbeat_init_zero;
  heartbeat.resend_first_seq = first + 10;
  heartbeat.resend_next_seq = first + 40;
  station.send_heartbeat(heartbeat);
  station.frames.clear();
  station.run(60);
  expect_no_hole();
  std::size_t again = 0;
  for (const auto& batch : batches(true)) again += batch.position_m_count;
  EXPECT_EQ(again, 30u);
}

TEST_F(Telemetry, ARequestForSamplesThatNeverWereIsHarmless) {
  protocol::StationHeartbeat heartbeat = rheonaut_StationHeartbeat_init_zero;
  heartbeat.resend_first_seq = 0;
  heartbeat.resend_next_seq = UINT64_MAX;
  station.send_heartbeat(heartbeat);
  station.run(50);
  heartbeat.resend_first_seq = 1'000'000;
  station.send_heartbeat(heartbeat);
  station.run(50);
  expect_no_hole();
}

TEST_F(Telemetry, ALongOutageLosesTheOldestAndSaysSo) {
  station.disconnect();
  const auto next = next_seq();
  station.run(1000);
  station.connect();
  EXPECT_EQ(station.hello->oldest_seq, next_seq() - TelemetryRing::kCapacity);
  EXPECT_GT(station.hello->oldest_seq, next);
  station.run(600);
  EXPECT_GE(last_status().lost_samples, 195u);
}

TEST_F(Telemetry, ExactlyWhatIsCountedAsLostIsMissing) {
  station.disconnect();
  station.run(1000);
  station.connect();
  station.keeps_samples = false;  // the samples are durable here as they come as backfill, across the gap
  station.frames.clear();
  std::uint64_t oldest_seq = 0;
  for (int i = 0; i < 600; ++i) {
    station.step();
    const auto backfill = batches(true);
    if (backfill.empty()) continue;
    const protocol::Telemetry& last = backfill.back();
    oldest_seq = last.oldest_seq;
    protocol::StationHeartbeat heartbeat = rheonaut_StationHeartbeat_init_zero;
    heartbeat.durable_next_seq = last.first_seq + last.position_m_count;
    station.send_heartbeat(heartbeat);
  }
  std::uint64_t missing = 0;
  for (std::uint64_t seq = station.samples.begin()->first; seq < station.samples.rbegin()->first; ++seq) {
    if (station.samples.count(seq) != 0) continue;
    ++missing;
    EXPECT_LT(seq, oldest_seq);
  }
  EXPECT_GE(missing, 195u);
  EXPECT_EQ(missing, last_status().lost_samples);
}

TEST_F(Telemetry, EventsThatNobodyKeptAreCountedAsLost) {
  const auto durable = station.events.back().event_seq + 1;
  station.keeps_samples = false;
  for (int i = 0; i < 40; ++i) order(i % 2 == 0 ? set_auto(0) : set_manual());
  station.run(101);
  const protocol::Event& last_event = station.events.back();
  EXPECT_EQ(last_event.oldest_event_seq, last_event.event_seq + 1 - EventRing::kCapacity);
  EXPECT_EQ(last_status().lost_events, last_event.oldest_event_seq - durable);
}

TEST_F(Telemetry, HelloSaysHowFarTheBootWasAcknowledgedWhateverTheRingDroppedSince) {
  station.keeps_samples = false;
  station.run(100);
  const std::uint64_t acknowledged = next_seq() - 10;
  const std::uint64_t events = station.events.back().event_seq + 1;
  protocol::StationHeartbeat heartbeat = rheonaut_StationHeartbeat_init_zero;
  heartbeat.durable_next_seq = acknowledged;
  heartbeat.durable_next_event_seq = events;
  station.send_heartbeat(heartbeat);
  heartbeat.durable_next_seq = heartbeat.durable_next_event_seq = 1'000'000;  // never made: ignored
  station.send_heartbeat(heartbeat);
  station.disconnect();
  station.run(1000);
  station.connect();
  EXPECT_EQ(station.hello->acknowledged_next_seq, acknowledged);
  EXPECT_EQ(station.hello->acknowledged_next_event_seq, events);
  EXPECT_GT(station.hello->oldest_seq, acknowledged);
}

TEST_F(Telemetry, AStalledTransportDelaysNothingButItself) {
  for (int i = 0; i < 300; ++i) {  // nobody listens
    robot.step();
    station.send_heartbeat(rheonaut_StationHeartbeat_init_zero);
  }
  station.frames.clear();
  station.listen();
  ASSERT_FALSE(batches(false).empty());
  EXPECT_GE(batches(false).front().first_seq, next_seq() - 101);  // what is old is no longer live
  station.run(300);
  expect_no_hole();
}

TEST_F(Telemetry, AFrameThatDoesNotFitStaysDue) {
  robot.step();
  order(ping());
  station.send(ping());
  std::uint8_t tiny[4], enough[protocol::kMaxFramedBytes];
  EXPECT_EQ(robot.transmit(tiny, sizeof tiny, robot.robot_time_us()), 0u);
  EXPECT_GT(robot.transmit(enough, sizeof enough, robot.robot_time_us()), 0u);
}

TEST_F(Telemetry, EventsAreKeptUntilDurableAndSentAgainAfterAReconnect) {
  station.keeps_samples = false;
  order(set_auto(0.1F));
  const auto known = station.events.size();
  ASSERT_GT(known, 0u);
  station.disconnect();
  station.events.clear();
  station.samples.clear();
  station.connect();
  station.run(10);
  EXPECT_EQ(station.events.front().kind, rheonaut_EVENT_KIND_MODE_CHANGED);  // boot was acknowledged before

  station.events.clear();
  protocol::StationHeartbeat again = rheonaut_StationHeartbeat_init_zero;
  again.resend_events = true;
  station.send_heartbeat(again);
  station.run(2);
  EXPECT_EQ(station.events.front().kind, rheonaut_EVENT_KIND_MODE_CHANGED);
}

TEST_F(Telemetry, EventsAreNumberedWithoutHoles) {
  for (int i = 0; i < 20; ++i) order(i % 2 == 0 ? set_auto(0.1F) : set_manual());
  for (std::size_t i = 0; i < station.events.size(); ++i) EXPECT_EQ(station.events[i].event_seq, i);
  EXPECT_EQ(station.events.front().kind, rheonaut_EVENT_KIND_BOOT);
}

TEST_F(Telemetry, AcksGoAheadOfEverythingThatWaits) {
  for (int i = 0; i < 50; ++i) {
    robot.step();
    station.send_heartbeat(rheonaut_StationHeartbeat_init_zero);
  }
  station.send(ping());
  station.frames.clear();
  station.listen();
  EXPECT_EQ(station.frames.front().which_body, pb_size_t{rheonaut_RobotFrame_command_ack_tag});
}

TEST_F(Telemetry, TheAckOfAStopGoesAheadOfOtherAcks) {
  for (int i = 0; i < 20; ++i) station.send(ping());
  const auto stop = station.send(emergency_stop());
  station.listen();
  EXPECT_EQ(station.acks.front().command_id, stop);
}

TEST_F(Telemetry, StatusComesOnceASecond) {
  station.run(1000);
  int count = 0;
  for (const auto& frame : station.frames) count += frame.which_body == rheonaut_RobotFrame_status_tag;
  EXPECT_EQ(count, 10);
}

TEST_F(Telemetry, TicksThatAreMissedAllTheTimeAreOneEventASecond) {
  station.run(200);
  const auto before = station.events.size();
  for (int i = 0; i < 100; ++i) {  // of 5 s
    robot.skip(1);
    station.run(4);
  }
  float told_s = 0;
  for (std::size_t i = before; i < station.events.size(); ++i) {
    ASSERT_EQ(station.events[i].kind, rheonaut_EVENT_KIND_TIME_STEP);
    told_s += station.events[i].value;
  }
  EXPECT_GE(station.events.size() - before, 4u);
  EXPECT_LE(station.events.size() - before, 6u);
  EXPECT_GT(told_s, 0.8F);
  EXPECT_LE(told_s, 1.001F);
}

}  // namespace
}  // namespace robot_fw
