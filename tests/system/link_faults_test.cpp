// What a bad link, a reboot and an emergency do to the whole system: nothing is lost, and nothing moves by itself.
#include "tests/system/station_fixture.hpp"

namespace server {
namespace {

using namespace sim_robot::conditions;
using sim_robot::set_auto;

class LinkFaultsTest : public SystemTest {
 protected:
  // No way from the robot to the station, until reconnect().
  void cut_for_good() {
    robot->redial = false;
    robot->cut();
  }
  void reconnect() { robot->dial(*listener); }
};

TEST_F(LinkFaultsTest, ACutLinkLosesNoSampleThatTheRingHolds) {
  begin();
  const storage::RunId run = begin_run();
  for (int i = 2; i <= 4; ++i) {
    pass(2);
    robot->cut();
    await(connections().is(i) and link_up() and in_truth(link_up()), {.limit_s = 3});
  }
  pass(5);
  expect_whole(run);
}

TEST_F(LinkFaultsTest, AStallOf5SecondsLosesNoSample) {
  begin();
  const storage::RunId run = begin_run();
  pass(1);
  robot->redial = false;
  robot->stall(true);
  await(link_lost() and in_truth(link_lost()), {.limit_s = 3});
  pass(4);
  reconnect();
  pass(6);
  expect_whole(run);
}

TEST_F(LinkFaultsTest, AnOutageLongerThanTheRingLeavesACountedGap) {
  begin();
  const storage::RunId run = begin_run();
  pass(1);
  cut_for_good();
  pass(12);
  reconnect();
  pass(10);
  const auto ended = wait_for(runs->end(run, ""));
  EXPECT_GT(ended->samples_lost, 300u);
  EXPECT_LT(ended->samples_lost, 600u);
  EXPECT_EQ(ended->samples_stored + ended->samples_lost, ended->samples_expected);
  const auto gaps = wait_for(history->gaps(storage::excerpt_of(run)));
  std::uint64_t lost = 0;  // in one stretch, noticed in one or more pieces while the ring moved on
  for (const storage::Gap& gap : gaps->gaps) {
    lost += gap.last_seq - gap.first_seq + 1;
    if (&gap != &gaps->gaps.front()) EXPECT_EQ(gap.first_seq, (&gap - 1)->last_seq + 1);
  }
  EXPECT_EQ(lost, ended->samples_lost);
  expect(caught_up());  // the acknowledgement passes over the gap
}

// More reach the robot together than it can keep acknowledgements of.
TEST_F(LinkFaultsTest, CommandsThatAStallHeldUpAllRunAndAreAllAcknowledged) {
  begin();
  pass(1);
  robot->stall(true);
  std::vector<sim_robot::Sent> sent;
  for (int i = 0; i < 14; ++i) sent.push_back(send(sim_robot::ping()));
  pass(0.8);
  robot->stall(false);
  for (const sim_robot::Sent& ping : sent) ping.expect_accepted({.limit_s = 1});
  EXPECT_EQ(robot->core().commands_received(), 14u);
}

TEST_F(LinkFaultsTest, OfTheSetpointsThatAStallHeldUpTheRecordSaysWhichHaveRun) {
  begin();
  go_to(0.2);
  const std::uint64_t before = robot->core().commands_received();
  robot->stall(true);
  std::vector<sim_robot::Sent> sent;
  for (int i = 1; i <= 14; ++i) {
    sent.push_back(send(sim_robot::set_setpoint(0.2F + 0.005F * static_cast<float>(i))));
    pass(0.05);
  }
  robot->stall(false);
  std::uint64_t has_run = 0;
  for (const sim_robot::Sent& setpoint : sent) {
    const std::string answer = setpoint.answer({.limit_s = 1}).text;
    if (answer == "accepted") {
      ++has_run;
    } else {
      EXPECT_EQ(answer, "by_a_newer_command") << "it was never sent";
    }
  }
  EXPECT_EQ(has_run, robot->core().commands_received() - before);
  EXPECT_EQ(sent.back().answer().text, "accepted");
}

TEST_F(LinkFaultsTest, LinkLossStopsTheMotorAndNothingMovesWhenItReturns) {
  begin();
  go_to(0.5);
  await(in_truth(duty().above(0.5)), {.limit_s = 1});
  robot->stall(true);
  await(in_truth(motor_off()), {.limit_s = 1.1});  // link time-out of 1 s
  await(connections().is(2) and link_up() and in_truth(link_up()));
  pass(2);
  expect(in_manual() and in_truth(motor_off()));
  EXPECT_FALSE(state().context.setpoint_m.has_value());
  expect_events({"link_lost", "link_restored"});
}

TEST_F(LinkFaultsTest, ADutyLivesAsLongAsItsLeaseIsRenewed) {
  begin();
  const storage::RunId run = begin_run();
  start_driving(0.4);
  holds(in_truth(motor_on()), {.for_s = 3});
  robot->stall(true);
  await(in_truth(motor_off()), {.limit_s = 0.6});
  expect_event("lease_lapsed", {.within_s = 5});
  holds(in_truth(motor_off()), {.for_s = 3});  // a lease that has run out is renewed by nobody
  pass(3);
  expect_whole(run);
}

TEST_F(LinkFaultsTest, TheNextSampleAfterAnEmergencyStopHasDuty0) {
  begin();
  const storage::RunId run = begin_run();
  go_to(0.5);
  await(duty().above(0.5), {.limit_s = 0.3});
  const auto stopped = stop();
  EXPECT_NE(stopped.emergency_id, 0u);
  pass(0.5);
  send(set_auto(0.1F)).expect_refused("latched");

  stop();
  send(sim_robot::clear_emergency(stopped.emergency_id)).expect_refused("other_emergency");
  expect(in_emergency());
  clear();
  pass(1);
  expect(in_manual());
  ASSERT_TRUE(wait_for(runs->end(run, "")).has_value());
  int after = 0;
  for (const storage::StoredSample& sample : samples_of(run)) {
    if (sample.robot_time_us <= stopped.effect_at_robot_us) continue;
    EXPECT_EQ(sample.sample.duty, 0) << "sample " << sample.seq;
    ++after;
  }
  EXPECT_GT(after, 100);
}

// SAFETY: a button in the motor's supply needs neither station nor link, and lets nothing move when it is let go.
TEST_F(LinkFaultsTest, AMotorSupplyThatIsCutStopsTheRobotAndOnlyAClearLetsItGoOn) {
  begin();
  go_to(0.5);
  await(duty().above(0.5), {.limit_s = 0.3});
  robot->world().cut_motor_supply(true);
  expect_event("emergency", {.within_s = 1});
  expect(in_emergency());
  EXPECT_EQ(state().context.emergency_cause, rheonaut_EMERGENCY_CAUSE_MOTOR_SUPPLY_CUT);
  send(sim_robot::clear_emergency(state().context.emergency_id)).expect_refused("cause_stands");
  robot->world().cut_motor_supply(false);
  holds(in_truth(motor_off()), {.for_s = 3});
  expect(in_emergency());
  clear();
  pass(1);
  expect(in_manual());
  expect(in_truth(motor_off()));
}

TEST_F(LinkFaultsTest, AStopDuringAnOutageReachesTheRobotFirst) {
  begin();
  go_to(0.5);
  cut_for_good();
  await(link_lost(), {.limit_s = 1});
  EXPECT_EQ(send(sim_robot::emergency_stop()).answer().text, "queued");
  reconnect();
  await(in_truth(in_emergency() and motor_off()), {.limit_s = 0.1});
  pass(0.1);
  EXPECT_FALSE(state().pending_stop.has_value());
  EXPECT_EQ(state().context.emergency_id, robot->core().emergency_id());
}

TEST_F(LinkFaultsTest, ARebootOpensANewSpanOfTheRun) {
  begin();
  const storage::RunId id = begin_run();
  pass(1);
  cut_for_good();
  pass(1.5);
  const auto first_boot = std::move(robot);
  sim_robot::SimulatedRobotConfig rebooted;
  rebooted.boot_id = 2;
  robot = std::make_unique<VirtualRobot>(loop, clock, tasks, rebooted);
  reconnect();
  pass(3);
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
