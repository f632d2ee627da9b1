// What the station makes of a robot's clock: for a boot, over connections, and when its own clock is set.
#include <algorithm>

#include "tests/server/link/link_fixture.hpp"

namespace server {
namespace {

class RobotClockTest : public LinkTest {
 protected:
  // Answers the next probe, `there` after it was sent.
  void answer_probe(TestRobot& robot, microseconds there = 10ms) {
    const auto known = robot.heartbeats().size();
    const auto probe = [&] {
      const auto received = robot.heartbeats();
      const auto found = std::find_if(received.begin() + static_cast<std::ptrdiff_t>(known), received.end(),
                                      [](const auto& heartbeat) { return heartbeat.station_time_us != 0; });
      return found == received.end() ? 0 : found->station_time_us;
    };
    ASSERT_TRUE(clock.run_until([&] { return probe() != 0; }, 2s));
    const std::uint64_t station_time_us = probe();
    clock.run_for(there);
    protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
    frame.which_body = rheonaut_RobotFrame_heartbeat_tag;
    frame.body.heartbeat.echo_station_time_us = station_time_us;
    frame.body.heartbeat.echo_received_at_robot_us = robot.robot_now_us();
    robot.send(frame);
    clock.settle();
  }

  void reconnect(TestRobot& before, TestRobot& robot, std::uint64_t boot_id) {
    before.link.cut();
    clock.settle();
    auto hello = TestRobot::hello_frame();
    hello.body.hello.boot_id = boot_id;
    robot.send(hello);
    ASSERT_TRUE(clock.run_until([&] { return !robot.welcomes().empty(); }, 1s));
    robot.keep_talking();
    clock.settle();
  }

  const station::ClockEstimate& estimate() const { return station.find("r1")->clock; }
};

TEST_F(RobotClockTest, TheEstimateOutlivesAConnectionAndNotABoot) {
  auto* first = connect();
  answer_probe(*first);
  ASSERT_TRUE(estimate().valid);

  auto* again = dial();
  again->booted_at_us = first->booted_at_us;
  reconnect(*first, *again, 77);
  ASSERT_TRUE(estimate().valid);
  again->send_samples(0, 5, again->robot_now_us() - 4'000'000, 0);  // from the ring, before any exchange of this link
  clock.settle();
  ASSERT_FALSE(sink.batches.empty());
  EXPECT_GE(sink.batches.back().clock_uncertainty_us, 10'000 / 2 + 390);  // half the round trip, and 4 s at 100 ppm
  EXPECT_LT(sink.batches.back().clock_uncertainty_us, 20'000);

  auto* rebooted = dial();
  reconnect(*again, *rebooted, 78);
  EXPECT_FALSE(estimate().valid);
  rebooted->send_samples(0, 5, rebooted->robot_now_us(), 0);
  clock.settle();
  EXPECT_EQ(sink.batches.back().clock_uncertainty_us, -1);
}

TEST_F(RobotClockTest, IsRecordedAtFirstAndThenOnceAMinute) {
  auto* robot = connect();
  for (int i = 0; i < 130; ++i) answer_probe(*robot, 1ms);
  ASSERT_EQ(sink.clocks.size(), 3u);
  const station::ClockRecord& latest = sink.clocks.back();
  EXPECT_EQ(latest.boot_id, 77u);
  EXPECT_EQ(latest.station_step_us, 0);
  EXPECT_GE(latest.robot_time_us, sink.clocks[1].robot_time_us + 60'000'000);
  const std::int64_t true_offset_us = robot->booted_at_us + clock.utc_us() - clock.steady_us();
  EXPECT_LE(std::abs(latest.utc_offset_us - true_offset_us), latest.uncertainty_us);
}

TEST_F(RobotClockTest, AStationClockThatIsSetIsRecordedAndMovesNoRobotTime) {
  auto* robot = connect();
  answer_probe(*robot);
  const std::int64_t before_us = estimate().offset_us;
  const std::int64_t recorded_us = sink.clocks.back().utc_offset_us;
  clock.step_utc(3600s);
  answer_probe(*robot);
  EXPECT_NEAR(static_cast<double>(estimate().offset_us - before_us), 0, 10'000);
  ASSERT_EQ(sink.clocks.size(), 2u);
  EXPECT_EQ(sink.clocks.back().station_step_us, 3'600'000'000);
  EXPECT_NEAR(static_cast<double>(sink.clocks.back().utc_offset_us - recorded_us), 3.6e9, 10'000);
  const auto is_set = [](const station::RobotEvent& event) { return event.kind == "station_clock_set"; };
  ASSERT_EQ(std::ranges::count_if(sink.events, is_set), 1);

  clock.step_utc(-3600s);
  answer_probe(*robot);
  ASSERT_EQ(sink.clocks.size(), 3u);
  EXPECT_EQ(sink.clocks.back().station_step_us, -3'600'000'000);
}

}  // namespace
}  // namespace server
