// How a robot's live state follows its hello and its samples.
#include "server/station/live_state.hpp"

#include "tests/server/station/entry_fixture.hpp"

namespace server {
namespace {

class LiveStateTest : public EntryTest {
 protected:
  void connect(station::BootId boot_id, std::uint64_t robot_time_us = 2'000'000) {
    station::AdmissionRequest hello;
    hello.robot_id = robot.id;
    hello.boot_id = boot_id;
    hello.robot_time_us = robot_time_us;
    hello.sample_period_us = 10'000;
    protocol::Hello details = rheonaut_Hello_init_zero;
    details.next_seq = 40;
    begin_connection(entry, hello, details, station::Admission{}, "memory", clock.steady_us());
  }
  static station::SampleBatch batch_of(std::uint64_t first_seq, std::uint64_t first_robot_time_us,
                                       std::uint64_t emergency_id = 0) {
    station::SampleBatch batch;
    batch.first_seq = first_seq;
    batch.first_robot_time_us = first_robot_time_us;
    batch.context.period_us = 10'000;
    batch.context.emergency_id = emergency_id;
    batch.samples.resize(5);
    return batch;
  }
};

TEST_F(LiveStateTest, AnotherBootBeginsAnewAndTheSameGoesOn) {
  robot.next_seq = 100;
  robot.at_power_s = 3;
  entry.timed.by = {"session:1", ""};
  connect(7);
  EXPECT_EQ(robot.link, station::LinkState::connected);
  EXPECT_EQ(robot.next_seq, 100u);
  EXPECT_EQ(entry.timed.by.actor, "session:1");
  connect(8);
  EXPECT_EQ(robot.next_seq, 40u);
  EXPECT_EQ(entry.timed.by.actor, "");
  EXPECT_EQ(robot.at_power_s, 3) << "the motor has not cooled down";
  EXPECT_EQ(entry.connected_at_robot_us, 2'000'000u);
}

TEST_F(LiveStateTest, SamplesThatAreSentAgainChangeNothing) {
  robot.next_seq = 100;
  robot.context.controller_id = 3;
  EXPECT_FALSE(show_samples(entry, batch_of(90, 1'000'000), config::CommandLimits{}));
  EXPECT_EQ(robot.context.controller_id, 3u);
  EXPECT_TRUE(show_samples(entry, batch_of(100, 1'000'000), config::CommandLimits{})) << "another controller";
  EXPECT_EQ(robot.next_seq, 105u);
  EXPECT_EQ(entry.orders.next_sample_at_robot_us(), 1'050'000u);
}

TEST_F(LiveStateTest, ABatchFromBeforeAStopsAnswerDoesNotUndoTheLatch) {
  robot.context.emergency_id = 9;
  entry.latch_known_at_robot_us = 1'000'001;
  show_samples(entry, batch_of(0, 1'000'000), config::CommandLimits{});
  EXPECT_EQ(robot.context.emergency_id, 9u);
  show_samples(entry, batch_of(5, 1'050'000), config::CommandLimits{});
  EXPECT_EQ(robot.context.emergency_id, 0u);
}

TEST_F(LiveStateTest, TimeAtPowerCountsUpAndDown) {
  station::SampleBatch batch = batch_of(0, 1'000'000);
  for (station::Sample& sample : batch.samples) sample.duty = 0.95F;
  show_samples(entry, batch, config::CommandLimits{});
  EXPECT_DOUBLE_EQ(robot.at_power_s, 0.05);
  show_samples(entry, batch_of(5, 1'050'000), config::CommandLimits{});
  EXPECT_NEAR(robot.at_power_s, 0, 1e-12);
}

}  // namespace
}  // namespace server
