// Fleets over real TCP connections: every sample is accounted for, whatever happens to the station.
#include "sim_robot/fleet/fleet.hpp"

#include <gtest/gtest.h>

#include <boost/asio/co_spawn.hpp>
#include <map>
#include <optional>
#include <stdexcept>
#include <thread>

#include "sim_robot/client/robot_client.hpp"
#include "sim_robot/fleet/fleet_report.hpp"
#include "sim_robot/fleet/replayed_robot.hpp"
#include "sim_robot/lab/station_peer.hpp"
#include "tests/sim_robot/telemetry_sink.hpp"

namespace sim_robot {
namespace {

namespace asio = boost::asio;
using namespace std::chrono_literals;

// A fleet and its station on one loop, in real time. A stall of the machine costs ticks and may cost a connection while
// it is made, but no sample that was made: the links outlive a silence of 5 s, the longest that robots accept, and a
// ring holds 8 s.
class FleetTest : public ::testing::Test {
 protected:
  FleetTest() { sink.link_timeout_ms = 5000; }

  void start(int robots) {
    Fleet::Members members;
    for (int i = 1; i <= robots; ++i) {
      SimulatedRobotConfig config;
      config.robot_id = "sim-" + std::to_string(i);
      config.boot_id = random_boot_id();
      config.samples_per_frame = 10;
      members.push_back(std::make_unique<RobotClient>(loop, config, station(), LinkLog{}));
    }
    run(std::move(members), 10ms);
  }
  void start_replay(int robots) {
    Fleet::Members members;
    for (int i = 1; i <= robots; ++i) {
      const ReplayConfig config{"sim-" + std::to_string(i), "", random_boot_id(), 10'000};
      members.push_back(std::make_unique<ReplayedRobot>(loop, config, recording, station(), LinkLog{}));
    }
    run(std::move(members), ReplayedRobot::turn_period(recording, 10'000));
  }
  void run(Fleet::Members members, std::chrono::microseconds period) {
    fleet.emplace(loop, std::move(members), period);
    asio::co_spawn(loop, fleet->run(), [](const std::exception_ptr& error) {
      if (error) std::rethrow_exception(error);
    });
  }
  StationAddress station() const { return {"127.0.0.1", std::to_string(sink.port())}; }

  // Runs the loop until the condition holds. Returns false after 2 min: the wait ends then, and no time is judged.
  template <class Condition>
  bool run_until(Condition condition) {
    const auto give_up_at = std::chrono::steady_clock::now() + 2min;
    while (!condition() && std::chrono::steady_clock::now() < give_up_at) loop.run_one_for(100ms);
    return condition();
  }
  bool all_acknowledged(std::uint64_t robots, std::uint64_t samples_each) {
    return run_until([&] {
      for (std::uint64_t i = 0; i < robots; ++i) {
        if (fleet->robot(i).samples().acknowledged < samples_each) return false;
      }
      return true;
    });
  }
  const StoredBoot& stored(const std::string& robot_id) const {
    for (const auto& [id, boot] : sink.boots()) {
      if (boot.robot_id == robot_id) return boot;
    }
    throw std::out_of_range("nothing came of " + robot_id);
  }
  void expect_exact() const {
    const SampleCounts sum = fleet->counts().samples;
    EXPECT_EQ(sum.made, sum.acknowledged + sum.held + sum.lost);
    EXPECT_GE(sum.made + sum.resent, sum.sent);
    EXPECT_GE(sum.sent, sum.acknowledged);
    EXPECT_LE(sum.acknowledged, sink.samples());
    EXPECT_LE(sink.samples(), sum.sent);
  }

  asio::io_context loop{1};
  TelemetrySink sink{loop};
  Recording recording = make_recording(2, 10, 1);
  std::optional<Fleet> fleet;
};

TEST_F(FleetTest, TwentyRobotsConnectAndEverySampleIsAccountedFor) {
  start(20);
  ASSERT_TRUE(all_acknowledged(20, 100));
  const FleetCounts counts = fleet->counts();
  EXPECT_EQ(counts.welcomed, 20u);
  EXPECT_EQ(counts.connected, 20u);
  EXPECT_EQ(counts.reconnects, 0u);
  EXPECT_EQ(counts.samples.lost, 0u);
  EXPECT_EQ(counts.samples.gaps, 0u);
  EXPECT_EQ(sink.boots().size(), 20u);
  for (const auto& [id, boot] : sink.boots()) EXPECT_EQ(boot.missing, 0u);
  expect_exact();
  FleetCounts judged = counts;
  judged.samples.missed_ticks = 0;  // a stall of this machine costs some
  EXPECT_FALSE(fleet_fault({1, 0, judged, 0}));
  judged.samples.missed_ticks = judged.samples.made;
  const auto fault = fleet_fault({1, 0, judged, 0});
  ASSERT_TRUE(fault);
  EXPECT_NE(fault->reason.find("too slow for the fleet"), std::string::npos);
}

TEST_F(FleetTest, RobotsAreSpreadOverTheSlots) {
  start(20);
  ASSERT_EQ(fleet->slots(), 4u);
  ASSERT_TRUE(run_until([&] { return fleet->counts().booted == 20; }));
  std::map<std::int64_t, int> robots_at;  // by slot of the period
  for (std::size_t i = 0; i < 20; ++i) {
    const auto at = fleet->robot(i).next_tick_at().time_since_epoch();
    ++robots_at[std::chrono::duration_cast<std::chrono::microseconds>(at).count() % 10'000];
  }
  EXPECT_EQ(robots_at.size(), 4u);
  for (const auto& [at, robots] : robots_at) EXPECT_EQ(robots, 5) << at;
  EXPECT_GT(fleet->lateness().count(), 0u);
}

TEST_F(FleetTest, AStationThatComesBackGetsWhatTheRingsHeld) {
  start(5);
  ASSERT_TRUE(all_acknowledged(5, 20));
  sink.close();
  const std::uint64_t made_before = fleet->counts().samples.made;
  ASSERT_TRUE(run_until([&] {
    const FleetCounts now = fleet->counts();
    return now.samples.made > made_before + 5 * 100 && now.links.unreachable > 0;
  }));
  sink.open();
  ASSERT_TRUE(all_acknowledged(5, fleet->robot(0).samples().made));
  const FleetCounts counts = fleet->counts();
  EXPECT_EQ(counts.reconnects, 5u);
  EXPECT_GT(counts.samples.resent, 0u);
  EXPECT_EQ(counts.samples.lost, 0u);
  for (const auto& [id, boot] : sink.boots()) EXPECT_EQ(boot.missing, 0u);
  expect_exact();
}

TEST_F(FleetTest, WhatTheRingCannotHoldIsCountedAsLostInOneGap) {
  sink.acknowledges = false;
  start(2);
  ASSERT_TRUE(run_until([&] { return fleet->robot(0).samples().lost > 0 && fleet->robot(1).samples().lost > 0; }));
  EXPECT_EQ(fleet->counts().samples.gaps, 2u);
  expect_exact();
  const auto fault = fleet_fault({1, 0, fleet->counts(), 0});
  ASSERT_TRUE(fault);
  EXPECT_EQ(fault->exit_status, 1);
  EXPECT_NE(fault->reason.find("lost in 2 gaps"), std::string::npos);
}

TEST_F(FleetTest, SamplesThatNobodyAcknowledgesAreNoSuccess) {
  start(2);
  ASSERT_TRUE(all_acknowledged(2, 10));
  const auto fault = fleet_fault({1, 0, fleet->counts(), 7});
  ASSERT_TRUE(fault);
  EXPECT_EQ(fault->exit_status, 1);
  EXPECT_EQ(fault->reason, "7 samples not acknowledged after the end");
}

TEST_F(FleetTest, TheBooksHoldOverReboots) {
  Fleet::Members members;
  members.push_back(std::make_unique<RobotClient>(loop, SimulatedRobotConfig{}, station(), LinkLog{}));
  auto& robot = dynamic_cast<RobotClient&>(*members.front());
  run(std::move(members), 10ms);
  ASSERT_TRUE(all_acknowledged(1, 50));
  sink.acknowledges = false;
  ASSERT_TRUE(run_until([&] { return robot.samples().held >= 30; }));
  const SampleCounts before = robot.samples();
  Reboot reboot;
  reboot.off_for_s = 0.1;
  robot.reboot(reboot);
  EXPECT_EQ(robot.samples().lost, robot.samples().made - before.acknowledged) << "the ring is gone";
  EXPECT_EQ(robot.samples().gaps, before.gaps + 1);
  sink.acknowledges = true;
  ASSERT_TRUE(run_until([&] { return robot.samples().acknowledged >= before.acknowledged + 50; }));
  EXPECT_EQ(fleet->counts().reconnects, 1u);
  EXPECT_EQ(sink.boots().size(), 2u);
  std::uint64_t stored_samples = 0;
  for (const auto& [id, boot] : sink.boots()) stored_samples += boot.samples;
  EXPECT_GE(stored_samples, robot.samples().acknowledged);
  EXPECT_GE(robot.samples().made, stored_samples);
}

TEST_F(FleetTest, AStalledFleetCountsEveryLateTickAndServesAllSlotsAgain) {
  start(20);
  ASSERT_TRUE(all_acknowledged(20, 20));
  const std::uint64_t ticks_before = fleet->lateness().count();
  std::this_thread::sleep_for(300ms);  // the stall itself
  ASSERT_TRUE(run_until([&] { return fleet->lateness().count() >= ticks_before + 20 * 25; }));
  EXPECT_GE(fleet->lateness().max_ms(), 250);
  const std::uint64_t made = fleet->robot(0).samples().made;
  ASSERT_TRUE(all_acknowledged(20, made + 20)) << "no slot is left out";
}

TEST_F(FleetTest, ARefusedRobotIsCountedAndDoesNotStopTheOthers) {
  sink.refused = {"sim-2"};
  start(3);
  ASSERT_TRUE(run_until([&] { return fleet->counts().links.refusals >= 2; }));
  ASSERT_TRUE(run_until([&] { return fleet->robot(0).samples().acknowledged > 0; }));
  ASSERT_TRUE(run_until([&] { return fleet->robot(2).samples().acknowledged > 0; }));
  EXPECT_EQ(fleet->counts().welcomed, 2u);
  const auto fault = fleet_fault({1, 0, fleet->counts(), 0});
  ASSERT_TRUE(fault);
  EXPECT_EQ(fault->reason, "1 of 3 robots never got in");
}

TEST_F(FleetTest, CommandsAreCounted) {
  start(3);
  ASSERT_TRUE(run_until([&] { return fleet->counts().welcomed == 3; }));
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_command_tag;
  frame.body.command = ping();
  frame.body.command.command_id = 1;
  sink.send_all(frame);
  ASSERT_TRUE(run_until([&] { return fleet->counts().samples.commands == 3; }));
}

TEST_F(FleetTest, WithoutAStationItSaysSo) {
  sink.close();
  start(3);
  ASSERT_TRUE(run_until([&] { return fleet->counts().links.unreachable >= 6; }));
  const auto fault = fleet_fault({1, 0, fleet->counts(), 0});
  ASSERT_TRUE(fault);
  EXPECT_EQ(fault->exit_status, 2);
  EXPECT_EQ(fault->reason, "no robot ever reached the station");
}

TEST_F(FleetTest, ReplayedRobotsAreAcknowledgedLikeOthers) {
  start_replay(20);
  ASSERT_TRUE(all_acknowledged(20, 100));
  EXPECT_EQ(fleet->counts().samples.lost, 0u);
  std::uint64_t repeated = 0;
  for (const auto& [id, boot] : sink.boots()) {
    EXPECT_EQ(boot.missing, 0u);
    repeated += boot.repeated;
  }
  EXPECT_LE(repeated, fleet->counts().samples.resent);  // a stall makes gaps, which the sink asks for again
  if (fleet->lateness().max_ms() < 100) EXPECT_EQ(repeated, 0u);
  expect_exact();
}

TEST_F(FleetTest, AReplayedRobotSendsAgainAfterAnOutageAndOnRequest) {
  start_replay(2);
  ASSERT_TRUE(all_acknowledged(2, 20));
  sink.close();
  const std::uint64_t made_before = fleet->counts().samples.made;
  ASSERT_TRUE(run_until([&] { return fleet->counts().samples.made > made_before + 2 * 100; }));
  sink.open();
  ASSERT_TRUE(all_acknowledged(2, fleet->robot(0).samples().made));
  EXPECT_EQ(fleet->counts().reconnects, 2u);
  EXPECT_EQ(fleet->counts().samples.lost, 0u);

  ASSERT_TRUE(run_until([&] { return fleet->robot(0).samples().held < 50; })) << "the backfill is over";
  sink.acknowledges = false;
  while (loop.poll() > 0) continue;  // the last acknowledgement arrives
  ASSERT_TRUE(run_until([&] { return fleet->robot(0).samples().held >= 90; }));
  const std::uint64_t acknowledged = fleet->robot(0).samples().acknowledged;
  const std::uint64_t repeated_before = stored("sim-1").repeated;
  protocol::StationFrame ask = rheonaut_StationFrame_init_zero;
  ask.which_body = rheonaut_StationFrame_heartbeat_tag;
  ask.body.heartbeat.resend_first_seq = acknowledged + 10;
  ask.body.heartbeat.resend_next_seq = acknowledged + 40;
  sink.send_all(ask);
  ASSERT_TRUE(run_until([&] { return stored("sim-1").repeated >= repeated_before + 30; }));
  expect_exact();
}

TEST_F(FleetTest, AReplayedRobotRefusesCommandsAndAnswersClockProbes) {
  std::uint64_t echoed = 0;
  sink.on_frame = [&](const protocol::RobotFrame& frame, const std::string&) {
    if (frame.which_body == rheonaut_RobotFrame_heartbeat_tag) echoed = frame.body.heartbeat.echo_station_time_us;
  };
  start_replay(1);
  ASSERT_TRUE(all_acknowledged(1, 10));
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_command_tag;
  frame.body.command = emergency_stop();
  frame.body.command.command_id = 1;
  sink.send_all(frame);
  ASSERT_TRUE(run_until([&] { return stored("sim-1").refused_commands == 1; }));
  frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_heartbeat_tag;
  frame.body.heartbeat.station_time_us = 4711;
  sink.send_all(frame);
  ASSERT_TRUE(run_until([&] { return echoed == 4711; }));
}

TEST(FleetReport, NamesTheSameFieldsInTextAndJson) {
  FleetSnapshot end{2, 0.5, {}, 0};
  end.counts.robots = end.counts.welcomed = 3;
  end.counts.samples = {1000, 900, 90, 10, 1, 1005, 5, 2, 0};
  const std::string json = summary_json(end, Lateness{}, "10 samples lost in 1 gaps");
  EXPECT_NE(json.find("\"samples_made\":1000"), std::string::npos);
  EXPECT_NE(json.find("\"cpu_us_per_sample\":500.0"), std::string::npos);
  const std::string text = summary_text(end, Lateness{}, "");
  EXPECT_NE(text.find("samples_lost          10\n"), std::string::npos);
  EXPECT_NE(text.find("result                nothing lost\n"), std::string::npos);
  const FleetSnapshot start;
  EXPECT_NE(rates_json(start, end, Lateness{}).find("\"made_per_s\":500.0"), std::string::npos);
  EXPECT_NE(rates_text(start, end, Lateness{}).find("made/s     500"), std::string::npos);
}

}  // namespace
}  // namespace sim_robot
