// The examples of docs/test_stories.md, which quotes them from here word for word.
#include <gtest/gtest.h>

#include "tests/sim_robot/story.hpp"

namespace sim_robot {
namespace {

class StoryExamples : public ::testing::Test, protected Story {};

TEST_F(StoryExamples, ASetpointIsReachedAndHeld) {
  begin();
  go_to(0.1);
  await(position().within(0.005).of(0.1), {.limit_s = 2});
  await(holding());
  holds(position().within(0.005).of(0.1) and in_truth(position().within(0.005).of(0.1)), {.for_s = 30});
  expect_event("sub_state_changed");
  expect_no_event("emergency");
}

TEST_F(StoryExamples, AnOutageStopsTheMotorByItselfAndLosesNothing) {
  begin();
  start_driving(0.4);  // the lease of 500 ms is renewed all the time
  holds(in_truth(duty().is(0.4)), {.for_s = 2});

  outage(3);
  await(in_truth(motor_off()), {.limit_s = 0.6});  // the lease has run out: no renewal arrives
  expect(motor_on());                              // which the station cannot know yet
  await(link_lost(), {.limit_s = 1});

  await(link_up() and caught_up(), {.limit_s = 10});
  expect_events({"lease_lapsed", "link_lost", "link_restored"});
  holds(in_truth(motor_off()), {.for_s = 5});  // nothing moves by itself
  send(renew_lease()).expect_refused("nothing_to_renew");
  expect_whole();
}

TEST_F(StoryExamples, AnElectrodeThatFailsInAutoIsAnEmergencyUntilItIsGoodAndCleared) {
  begin();
  go_to(0.5);
  suffer({.kind = FaultKind::electrode_missing, .for_s = 3});
  const ReceivedEvent fault = expect_event("sensor_fault");
  EXPECT_EQ(fault.cause, "impedance");
  await(in_emergency() and motor_off() and flagged(rheonaut_TELEMETRY_FLAG_SENSOR_FAULT));

  send(clear_emergency(fault.emergency_id)).expect_refused("other_emergency");
  send(clear_emergency(moment().received.emergency_id)).expect_refused("cause_stands");
  send(set_auto(0.1F)).expect_refused("latched");

  expect_event("sensor_recovered", {.within_s = 5});
  clear();
  expect(in_manual() and motor_off());
  go_to(0.1);
  await(holding(), {.limit_s = 10});
}

}  // namespace
}  // namespace sim_robot
