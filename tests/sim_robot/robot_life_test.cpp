// Reboots, brown-outs and clocks that lie: what outlives them, and what the station sees.
#include "tests/sim_robot/link_story.hpp"

namespace sim_robot {
namespace {

class RobotFaults : public LinkStory {
 protected:
  double drive_without_renewal_s() {
    station->send(set_duty(0.3F));
    EXPECT_TRUE(run_until([&] { return core().duty() != 0; }, 1));
    return time_to([&] { return core().duty() == 0; }, 5);
  }
};

TEST_F(RobotFaults, ARebootIsANewBootInManualWithTheMotorOff) {
  begin();
  ASSERT_TRUE(reached_auto(0.5F));
  station->run(1);
  const auto boot_id = station->hello->boot_id;
  const double moved_m = life.robot().world().position_m();
  life.reboot({});
  EXPECT_EQ(core().duty(), 0);
  ASSERT_TRUE(run_until([&] { return station->hello && station->hello->boot_id != boot_id; }, 5));
  EXPECT_EQ(station->hello->reset_cause, rheonaut_RESET_CAUSE_SOFTWARE);
  EXPECT_EQ(station->hello->mode, rheonaut_MODE_MANUAL);
  station->run(1);
  EXPECT_EQ(station->earlier_boots.size(), 1u);
  EXPECT_EQ(station->samples.begin()->first, 0u);
  EXPECT_GT(life.robot().world().position_m(), moved_m) << "it coasts through the reboot";
  expect_whole();
  expect_still();
}

TEST_F(RobotFaults, ARobotThatLosesPowerLeavesItsConnectionHalfOpen) {
  begin();
  life.reboot({rheonaut_RESET_CAUSE_POWER_ON, 20, false});
  ASSERT_TRUE(run_until([&] { return station->link_is_lost(); }, 2));
  EXPECT_FALSE(station->is_connected());
  EXPECT_EQ(link->connections(), 1);
  ASSERT_TRUE(run_until([&] { return station->link_is_up(); }, 25));
  EXPECT_GT(now_s(), 20);
}

TEST_F(RobotFaults, TheLatchOutlivesAResetWhereItsMemoryDoes) {
  begin();
  const auto stop = station->send(emergency_stop());
  station->run(0.1);
  const auto emergency_id = station->ack_of(stop)->emergency_id;
  ASSERT_NE(emergency_id, 0u);
  life.reboot({rheonaut_RESET_CAUSE_EXTERNAL});
  ASSERT_TRUE(run_until([&] { return life.is_on() && station->hello && link->connections() == 2; }, 5));
  EXPECT_EQ(station->hello->emergency_id, emergency_id);
  EXPECT_EQ(station->hello->emergency_cause, rheonaut_EMERGENCY_CAUSE_OPERATOR);
  life.reboot({rheonaut_RESET_CAUSE_POWER_ON, 1, false});
  ASSERT_TRUE(run_until([&] { return station->hello && link->connections() == 3; }, 5));
  EXPECT_EQ(station->hello->emergency_id, 0u);
}

TEST_F(RobotFaults, BrownOutAndWatchdogComeUpLatched) {
  begin();
  int connections = 1;
  for (const auto cause : {rheonaut_RESET_CAUSE_BROWN_OUT, rheonaut_RESET_CAUSE_WATCHDOG}) {
    ASSERT_TRUE(reached_auto(0.5F));
    life.reboot({cause, 0.8, false});
    ++connections;
    ASSERT_TRUE(run_until([&] { return link->connections() == connections && station->link_is_up(); }, 5));
    EXPECT_EQ(station->hello->reset_cause, cause);
    EXPECT_EQ(station->hello->mode, rheonaut_MODE_EMERGENCY);
    EXPECT_EQ(station->hello->emergency_cause, rheonaut_EMERGENCY_CAUSE_RESET);
    const auto refused = station->send(set_auto(0.1F));
    station->run(0.1);
    EXPECT_EQ(answer(refused), "latched");
    const auto cleared = station->send(clear_emergency(station->hello->emergency_id));
    station->run(0.1);
    EXPECT_EQ(answer(cleared), "accepted");
  }
}

TEST_F(RobotFaults, ParametersOutliveARebootAsLongAsTheFlashDoes) {
  begin();
  station->send(set_parameter("setpoint_limit_m", 0.25F));
  station->run(0.2);
  const auto limit_m = [&]() -> float {
    station->pages.clear();
    station->send(get_parameters(0));
    station->run(0.2);
    for (const auto& page : station->pages) {
      for (pb_size_t i = 0; i < page.parameters_count; ++i) {
        if (std::string(page.parameters[i].name) == "setpoint_limit_m") return page.parameters[i].value;
      }
    }
    return 0;
  };
  life.reboot({});
  ASSERT_TRUE(run_until([&] { return link->connections() == 2 && station->link_is_up(); }, 5));
  EXPECT_EQ(limit_m(), 0.25F);
  Reboot erased;
  erased.keeps_storage = false;
  life.reboot(erased);
  ASSERT_TRUE(run_until([&] { return link->connections() == 3 && station->link_is_up(); }, 5));
  EXPECT_EQ(limit_m(), 1.0F);
}

TEST_F(RobotFaults, CommandsForTheBootBeforeAreRefused) {
  begin();
  protocol::Command command = set_auto(0.1F);
  command.boot_id = station->hello->boot_id;
  life.reboot({});
  ASSERT_TRUE(run_until([&] { return link->connections() == 2 && station->link_is_up(); }, 5));
  const auto id = station->send(command);
  station->run(0.1);
  EXPECT_EQ(answer(id), "other_boot");
  expect_still();
}

TEST_F(RobotFaults, ADriftingClockMakesItsTicksFasterOrSlowerAndLosesNothing) {
  for (const double ppm : {200.0, -200.0}) {
    RobotLife drifting{{}};
    drifting.drift(ppm);
    ImpairedLink other{drifting};
    LinkedPeer peer{other};
    peer.run(100);
    EXPECT_NEAR(static_cast<double>(drifting.robot_clock_us()), 1e8 * (1 + 1e-6 * ppm), 1);
    EXPECT_EQ(other.connections(), 1);
    EXPECT_EQ(peer.lost_samples(), 0u);
    EXPECT_NEAR(static_cast<double>(peer.samples.rbegin()->second.robot_time_us), 1e8 * (1 + 1e-6 * ppm), 60'000);
    for (const auto& event : peer.events) EXPECT_NE(event.kind, rheonaut_EVENT_KIND_TIME_STEP);
  }
}

TEST_F(RobotFaults, AClockThatJumpsForwardIsATimeStepAndEndsWhatHasRunOut) {
  begin();
  ASSERT_TRUE(reached_auto(0.2F));
  life.jump_clock(5);
  station->step();
  EXPECT_EQ(core().duty(), 0) << "by its clock the station was silent for 5 s";
  EXPECT_EQ(core().mode(), rheonaut_MODE_MANUAL);
  ASSERT_TRUE(run_until([&] { return link->connections() == 2 && station->link_is_up(); }, 3));
  station->run(0.1);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_TIME_STEP), 1);
  EXPECT_FALSE(core().link_lost());
  expect_whole();
}

TEST_F(RobotFaults, AClockThatJumpsBackStopsTheRobotOnce) {
  begin();
  ASSERT_TRUE(reached_auto(0.2F));
  station->run(1);
  life.jump_clock(-0.5);
  station->run(0.1);
  EXPECT_EQ(core().duty(), 0);
  EXPECT_EQ(core().mode(), rheonaut_MODE_EMERGENCY);
  EXPECT_EQ(core().emergency_cause(), rheonaut_EMERGENCY_CAUSE_INTERNAL_ERROR);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_EMERGENCY), 1);
  const auto too_soon = station->send(clear_emergency(core().emergency_id()));
  station->run(0.1);
  EXPECT_EQ(answer(too_soon), "cause_stands") << "its time stands still until the clock has caught up";
  station->run(2);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_EMERGENCY), 1);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_TIME_STEP), 0);
  const auto cleared = station->send(clear_emergency(core().emergency_id()));
  station->run(0.5);
  EXPECT_EQ(answer(cleared), "accepted");
  EXPECT_EQ(core().mode(), rheonaut_MODE_MANUAL);
  EXPECT_LT(drive_without_renewal_s(), 0.6) << "and leases run out again";
  expect_whole();
}

TEST(RobotLife, TheBooksOfABootAreClosedWhenItEnds) {
  RobotLife life{{}};
  life.advance_to(1'000'000);
  const std::uint64_t made = life.core().samples().next_seq();
  life.reboot({});
  EXPECT_EQ(life.lost_at_reboot(), made);
  life.advance_to(2'000'000);
  const std::uint64_t made_then = life.core().samples().next_seq();
  EXPECT_GT(made_then, 0u);
  life.reboot({});
  EXPECT_EQ(life.earlier_boots().samples_made, made + made_then);
  EXPECT_EQ(life.earlier_boots().samples_lost, made + made_then) << "nobody acknowledged one";
}

}  // namespace
}  // namespace sim_robot
