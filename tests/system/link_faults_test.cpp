// What a bad link, a reboot and an emergency do to the whole system: nothing is lost, and nothing moves by itself.
#include "tests/system/station_fixture.hpp"

namespace server {
namespace {

class LinkFaultsTest : public SystemTest {
 protected:
  void expect_whole(RunId id) {
    const auto run = wait_for(runs->end(id, ""));
    ASSERT_TRUE(run.has_value());
    EXPECT_EQ(run->samples_lost, 0u);
    EXPECT_EQ(run->samples_stored, run->samples_expected);
    const auto samples = samples_of(id);
    ASSERT_EQ(samples.size(), run->samples_expected);
    for (std::size_t i = 1; i < samples.size(); ++i) ASSERT_EQ(samples[i].seq, samples[i - 1].seq + 1);
  }

  bool connected() const { return state().link == LinkState::connected; }
};

TEST_F(LinkFaultsTest, ACutLinkLosesNoSampleThatTheRingHolds) {
  add_robot();
  const RunId run = begin_run();
  for (int i = 0; i < 3; ++i) {
    clock.run_for(2s);
    robot->cut();
    ASSERT_TRUE(clock.run_until([&] { return connected() && robot->connected(); }, 3s));
  }
  clock.run_for(5s);
  expect_whole(run);
}

TEST_F(LinkFaultsTest, AStallOf5SecondsLosesNoSample) {
  add_robot();
  const RunId run = begin_run();
  clock.run_for(1s);
  robot->redial = false;
  robot->stall(true);
  ASSERT_TRUE(clock.run_until([&] { return !connected() && !robot->connected(); }, 3s));
  clock.run_for(4s);
  robot->dial(*listener);
  clock.run_for(6s);
  expect_whole(run);
}

TEST_F(LinkFaultsTest, AnOutageLongerThanTheRingLeavesACountedGap) {
  add_robot();
  const RunId run = begin_run();
  clock.run_for(1s);
  robot->redial = false;
  robot->cut();
  clock.run_for(12s);
  robot->dial(*listener);
  clock.run_for(10s);
  const auto ended = wait_for(runs->end(run, ""));
  EXPECT_GT(ended->samples_lost, 300u);
  EXPECT_LT(ended->samples_lost, 600u);
  EXPECT_EQ(ended->samples_stored + ended->samples_lost, ended->samples_expected);
  const auto gaps = wait_for(history->gaps(run));
  std::uint64_t lost = 0;  // in one stretch, noticed in one or more pieces while the ring moved on
  for (const Gap& gap : *gaps) {
    lost += gap.last_seq - gap.first_seq + 1;
    if (&gap != &gaps->front()) EXPECT_EQ(gap.first_seq, (&gap - 1)->last_seq + 1);
  }
  EXPECT_EQ(lost, ended->samples_lost);
  EXPECT_EQ(state().durable_next_seq, state().next_seq) << "the acknowledgement passes over the gap";
}

TEST_F(LinkFaultsTest, LinkLossStopsTheMotorAndNothingMovesWhenItReturns) {
  add_robot();
  command(set_auto(0.5F));
  ASSERT_TRUE(clock.run_until([&] { return robot->core().duty() > 0.5F; }, 1s));
  robot->stall(true);
  EXPECT_TRUE(clock.run_until([&] { return robot->core().duty() == 0; }, 1100ms)) << "link time-out of 1 s";
  ASSERT_TRUE(clock.run_until([&] { return connected() && robot->connected(); }, 5s));
  clock.run_for(2s);
  EXPECT_EQ(state().context.mode, rheonaut_MODE_MANUAL);
  EXPECT_FALSE(state().context.setpoint_m.has_value());
  EXPECT_EQ(robot->core().duty(), 0);
}

TEST_F(LinkFaultsTest, TheNextSampleAfterAnEmergencyStopHasDuty0) {
  add_robot();
  const RunId run = begin_run();
  command(set_auto(0.5F));
  clock.run_for(300ms);
  ASSERT_GT(state().sample->duty, 0.5F);
  const CommandRecord stopped = stop();
  EXPECT_EQ(stopped.state, CommandState::acknowledged);
  EXPECT_NE(stopped.emergency_id, 0u);
  clock.run_for(500ms);
  EXPECT_EQ(state().context.mode, rheonaut_MODE_EMERGENCY);
  EXPECT_EQ(refused_command(set_auto(0.1F)).reason, "latched");

  const CommandRecord again = stop();
  EXPECT_EQ(refused_command(clear_emergency(stopped.emergency_id)).reason, "other_emergency");
  EXPECT_EQ(state().context.mode, rheonaut_MODE_EMERGENCY);
  command(clear_emergency(again.emergency_id));
  clock.run_for(1s);
  EXPECT_EQ(state().context.mode, rheonaut_MODE_MANUAL);
  ASSERT_TRUE(wait_for(runs->end(run, "")).has_value());
  int after = 0;
  for (const StoredSample& sample : samples_of(run)) {
    if (sample.robot_time_us <= stopped.effect_at_robot_us) continue;
    EXPECT_EQ(sample.sample.duty, 0) << "sample " << sample.seq;
    ++after;
  }
  EXPECT_GT(after, 100);
}

TEST_F(LinkFaultsTest, AStopDuringAnOutageReachesTheRobotFirst) {
  add_robot();
  command(set_auto(0.5F));
  robot->redial = false;
  robot->cut();
  ASSERT_TRUE(clock.run_until([&] { return !connected(); }, 1s));
  EXPECT_EQ(stop().state, CommandState::queued);
  robot->dial(*listener);
  ASSERT_TRUE(clock.run_until([&] { return robot->core().emergency_id() != 0; }, 100ms));
  EXPECT_EQ(robot->core().duty(), 0);
  clock.run_for(100ms);
  EXPECT_FALSE(state().pending_stop.has_value());
  EXPECT_EQ(state().context.emergency_id, robot->core().emergency_id());
}

TEST_F(LinkFaultsTest, ARebootOpensANewSpanOfTheRun) {
  add_robot();
  const RunId id = begin_run();
  clock.run_for(1s);
  robot->redial = false;
  robot->cut();
  clock.run_for(1500ms);
  const auto first_boot = std::move(robot);
  sim_robot::SimulatedRobotConfig rebooted;
  rebooted.boot_id = 2;
  robot = std::make_unique<VirtualRobot>(loop, clock, tasks, rebooted);
  robot->dial(*listener);
  clock.run_for(3s);
  const auto run = wait_for(runs->end(id, ""));
  ASSERT_EQ(run->spans.size(), 2u);
  EXPECT_EQ(run->spans[1].boot_id, 2u);
  EXPECT_EQ(run->spans[1].first_seq, 0u);
  const auto samples = samples_of(id);
  EXPECT_EQ(samples.size(), run->samples_stored);
  tasks.stop();
  clock.settle();
}

}  // namespace
}  // namespace server
