// The words of a story: what they wait for, how fast, and what they say when it does not come.
#include "tests/sim_robot/story.hpp"

#include <gmock/gmock.h>

#include <chrono>
#include <ctime>

namespace sim_robot {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class StoryTest : public ::testing::Test, protected Story {
 protected:
  // What is said when this fails; empty when it does not.
  template <class Told>
  static std::string failure(Told told) {
    try {
      told();
    } catch (const StoryFailed& failed) {
      return failed.what();
    }
    return "";
  }
  double now_s() const { return moment().time_s; }
};

TEST_F(StoryTest, AwaitReturnsTheVirtualSecondsItTook) {
  begin();
  go_to(0.1);
  const double took_s = await(position().within(0.002).of(0.1), {.limit_s = 20});
  EXPECT_GT(took_s, 0.5);
  EXPECT_LT(took_s, 1.5);
  EXPECT_EQ(await(in_auto()), 0) << "what holds already takes no time";
}

TEST_F(StoryTest, AFailedAwaitSaysWhereWhatForHowLongAndWhatWasTheCase) {
  begin();
  go_to(0.1);
  pass(3);
  const std::string said = failure([&] { await(position().within(0.005).of(0.3) and holding(), {.limit_s = 2.5}); });
  EXPECT_THAT(said, HasSubstr("story_test.cpp:"));
  EXPECT_THAT(said, HasSubstr(": awaited for 2.5 s: position within 0.005 m of 0.3 m and holding\n"));
  EXPECT_THAT(said, HasSubstr("\n  instead   position is 0.1 m\n")) << "holding holds, and is not to blame";
  EXPECT_THAT(said, HasSubstr("\n  received  position 0.1 m, velocity "));
  EXPECT_THAT(said, HasSubstr(", impedance 175 mV, setpoint 0.1 m, auto holding, link up\n"));
  EXPECT_THAT(said, HasSubstr("\n  in truth  position 0.1 m, velocity "));
  EXPECT_THAT(said, HasSubstr("\n  events    boot 0 s, mode_changed "));
  EXPECT_THAT(said, HasSubstr(", sub_state_changed "));
  EXPECT_THAT(said, HasSubstr("\n  commands  set_mode accepted"));
}

TEST_F(StoryTest, TimeOutsAreInVirtualTime) {
  begin();
  const double begin_s = now_s();
  EXPECT_NE(failure([&] { await(in_emergency(), {.limit_s = 7}); }), "");
  EXPECT_NEAR(now_s() - begin_s, 7, 0.001);
  EXPECT_NE(failure([&] { expect_event("detection", {.within_s = 3}); }), "");
  EXPECT_NEAR(now_s() - begin_s, 10, 0.001);
  pass(1);
  EXPECT_NEAR(now_s() - begin_s, 11, 0.001);
}

// CPU time, because the machine may do something else meanwhile. A story that slept would take the whole minute.
TEST_F(StoryTest, AMinuteTakesAMomentOfRealTime) {
  begin();
  go_to(0.1);
  const auto start = std::chrono::steady_clock::now();
  const std::clock_t worked_before = std::clock();
  holds(in_auto(), {.for_s = 60});
  EXPECT_LT(std::clock() - worked_before, 5 * CLOCKS_PER_SEC) << "even with sanitizers";
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds{60});
}

TEST_F(StoryTest, HoldsFailsInTheMomentInWhichItDoesNot) {
  begin();
  start_driving(0.3);
  suffer({.kind = FaultKind::electrode_offset, .for_s = kForEver, .magnitude = -50});
  const std::string said = failure([&] { holds(impedance().above(150), {.for_s = 10}); });
  EXPECT_THAT(said, HasSubstr("expected to hold for 10 s: impedance above 150 mV\n  instead   after 0.0"));
  EXPECT_THAT(said, HasSubstr(" s impedance is 125 mV\n"));
  EXPECT_LT(now_s(), 1);
}

TEST_F(StoryTest, WhatTheStationReceivedAndTheTruthAreSeparate) {
  begin();
  start_driving(0.5);
  outage(3);
  pass(1);
  expect(motor_on() and in_truth(motor_off()));
  expect(in_truth(position()  // it coasts and nobody hears of it
                      .above(moment().received.position_m)));
  const std::string said = failure([&] { expect(in_truth(motor_on())); });
  EXPECT_THAT(said, HasSubstr("expected now: in truth motor on\n  instead   in truth duty is 0\n"));
}

TEST_F(StoryTest, InTruthOfWhatOnlyTelemetrySaysIsAMistake) {
  begin();
  EXPECT_THROW(expect(in_truth(holding())), std::logic_error);
  EXPECT_THROW(expect(in_truth(setpoint().is(0))), std::logic_error);
  EXPECT_THROW(expect(in_truth(flagged(rheonaut_TELEMETRY_FLAG_SATURATED))), std::logic_error);
}

TEST_F(StoryTest, ConditionsSayWhatTheyAre) {
  EXPECT_EQ((not link_up()).text(), "not link up");
  EXPECT_EQ((not(in_auto() and motor_on())).text(), "not (in auto and motor on)");
  EXPECT_EQ((in_manual() or in_emergency()).text(), "(in manual or in emergency)");
  EXPECT_EQ(in_truth(duty().below(0.5) and velocity().is(0)).text(), "in truth (duty below 0.5 and velocity is 0 m/s)");
  EXPECT_EQ(flagged(rheonaut_TELEMETRY_FLAG_SENSOR_FAULT).text(), "flagged sensor_fault");
  begin();
  const Moment now = moment();
  EXPECT_EQ((in_auto() and motor_on()).account(now), "it is in manual, duty is 0");
  EXPECT_EQ((in_manual() and motor_on()).account(now), "duty is 0");
  EXPECT_EQ((in_auto() or in_emergency()).account(now), "it is in manual");
  EXPECT_EQ(setpoint().above(0).account(now), "setpoint is none");
  EXPECT_EQ((not link_lost()).account(now), "link up");
}

TEST_F(StoryTest, AnEventAnswersOneExpectation) {
  begin();
  stop();
  clear();
  stop();
  const ReceivedEvent first = expect_event("emergency"), second = expect_event("emergency");
  EXPECT_LT(first.robot_time_s, second.robot_time_s);
  EXPECT_EQ(second.cause, "command");
  EXPECT_EQ(second.emergency_id, robot().core().emergency_id());
  expect_no_event("emergency");
  const std::string said = failure([&] { expect_no_event("emergency_cleared"); });
  EXPECT_THAT(said, AllOf(HasSubstr("expected none: event emergency_cleared\n"), HasSubstr("instead   one came at ")));
  EXPECT_THAT(failure([&] { expect_event("emergency"); }),
              HasSubstr("expected within 1 s: event emergency\n  instead   none came"));
}

TEST_F(StoryTest, EventsAreExpectedInTheirOrder) {
  begin();
  stop();
  clear();
  EXPECT_THAT(failure([&] { expect_events({"emergency_cleared", "emergency"}); }),
              HasSubstr("event emergency after emergency_cleared"));
  stop();
  expect_event("emergency");
  expect_no_event("emergency_cleared");
}

TEST_F(StoryTest, AnEventThatThereIsNotIsAMistake) {
  begin();
  EXPECT_THROW(expect_event("glucose"), std::invalid_argument);
  EXPECT_THROW(expect_no_event("link_gone"), std::invalid_argument);
}

TEST_F(StoryTest, AnAnswerThatIsAnotherOneOrNoneFails) {
  begin();
  EXPECT_THAT(failure([&] { send(set_setpoint(0.1F)).expect_accepted(); }),
              HasSubstr("expected: set_setpoint accepted\n  instead   the answer is wrong_mode\n"));
  EXPECT_THAT(failure([&] { send(ping()).expect_refused("latched"); }),
              HasSubstr("expected: ping refused as latched\n  instead   the answer is accepted\n"));
  send(set_setpoint(0.1F)).expect_refused("wrong_mode");
  outage(30);
  EXPECT_THAT(
      failure([&] { send(ping()).answer({.limit_s = 1.5}); }),
      AllOf(
          HasSubstr("awaited for 1.5 s: an answer to ping\n  instead   none came\n"),
          HasSubstr("\n  commands  set_setpoint wrong_mode, ping accepted, set_setpoint wrong_mode, ping unanswered")));
}

TEST_F(StoryTest, DrivesForItsTimeUnderARenewedLease) {
  begin();
  drive({.duty = 0.3, .for_s = 5});
  EXPECT_NEAR(moment().truth.position_m, 0.3 * 0.1 * 5, 0.01);
  expect(motor_off() and in_truth(motor_off()));
  expect_no_event("lease_lapsed");
  start_driving(-0.3);
  holds(in_truth(duty().is(-0.3)), {.for_s = 3});
  go_to(0.1);  // takes the stick out of its hands
  holds(in_auto(), {.for_s = 1});
  stop();
  EXPECT_THAT(failure([&] { drive({.duty = 0.3, .for_s = 1}); }), HasSubstr("the answer is latched"));
}

TEST_F(StoryTest, ALongDriveIsAcknowledgedBetweenItsRenewals) {
  begin();
  start_driving(0.1);
  pass(12);
  EXPECT_LT(status().ring_fill, 40u);
  expect_whole();
}

TEST_F(StoryTest, NothingLostFailsWhenSomethingWas) {
  begin();
  expect_whole();
  outage(12);
  pass(14);
  await(caught_up(), {.limit_s = 20});
  EXPECT_THAT(failure([&] { expect_whole(); }), AllOf(HasSubstr("expected: no sample lost\n"), HasSubstr("lost are ")));
}

TEST_F(StoryTest, ARobotThatNeverSendsHasNoStory) {
  Setting setting;
  setting.link.down.delay_s = setting.link.up.delay_s = 20;
  EXPECT_THAT(failure([&] { begin(setting); }), HasSubstr("awaited for 10 s: the first sample"));
}

}  // namespace
}  // namespace sim_robot
