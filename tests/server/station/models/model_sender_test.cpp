// What is sent to a robot of its fluid, in which order, and what becomes of it when something goes wrong.
#include <gmock/gmock.h>

#include <cmath>

#include "tests/server/captured_log.hpp"
#include "tests/server/station/models/model_fixture.hpp"

namespace server {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class ModelSenderTest : public ModelSenderFixture {};

// A sink that fails once, as nothing in the station should.
class FailsOnce final : public station::StationSink {
 public:
  void on_command(const station::CommandRecord& record) override {
    if (record.state == station::CommandState::queued && std::exchange(at_command, false)) fail();
  }
  void on_robot(const station::RobotState& robot) override {
    if (robot.model.state == station::ModelState::confirmed && std::exchange(at_confirmed, false)) fail();
  }
  bool at_command = false, at_confirmed = false;

 private:
  static void fail() { throw std::runtime_error{"no room for it"}; }
};

TEST_F(ModelSenderTest, WhatTheRobotDoesNotHoldYetIsSentAndThenConfirmed) {
  held["model_time_constant_2_s"] = 1;
  begin();
  EXPECT_EQ(model(), station::RobotModel{});
  name_fluid("water");
  EXPECT_EQ(model().state, station::ModelState::sending);
  EXPECT_EQ(model().fluid, "water");
  live(5s);
  EXPECT_THAT(sent, ElementsAre("model_gain_1_m_s", "model_gain_2_m_s", "model_gain_3_m_s", "model_time_constant_1_s",
                                "model_time_constant_3_s", "model_time_constant_4_s", "model_confirmed"));
  EXPECT_TRUE(holds_water());
  EXPECT_EQ(model().state, station::ModelState::confirmed) << model().reason;
  EXPECT_EQ(model().fluid, "water");
  EXPECT_EQ(model().fit_error, 0.002);
  EXPECT_EQ(model().set_at_us, some_model().set_at_us);
  EXPECT_THAT(events(), ElementsAre("model_confirmed"));
  EXPECT_EQ(sink.commands.back().actor, "token:local") << "on behalf of the actor that named the fluid";

  name_fluid("water");
  live(1s);
  EXPECT_EQ(sent.size(), 7U) << "it is confirmed already";
}

// SAFETY's test: who wrote it is in grave doubt about it, so the robot stays as unsure as without it.
TEST_F(ModelSenderTest, AModelInDoubtIsSentAsAssumedAndNeverConfirmed) {
  station::FluidModel doubted = some_model();
  doubted.assumed_because = "no linear model holds";
  held["model_section_error"] = 0.05F;
  begin();
  name_fluid("water");  // confirmed, before anybody had a doubt
  live(5s);
  ASSERT_EQ(model().state, station::ModelState::confirmed);
  sent.clear();
  models.put("water", doubted);
  name_fluid("water");
  live(5s);
  EXPECT_THAT(sent, ElementsAre("model_confirmed", "model_section_error"));
  EXPECT_EQ(held["model_confirmed"], 0);
  EXPECT_EQ(held["model_section_error"], station::kAssumedSectionError);
  EXPECT_TRUE(holds_water());
  EXPECT_EQ(model().state, station::ModelState::assumed);
  EXPECT_EQ(model().reason, "sent as assumed only, since it is in doubt: no linear model holds");
  EXPECT_EQ(model().fluid, "water");
  EXPECT_EQ(events().back(), "model_assumed");

  held["model_confirmed"] = 1;  // by somebody's command
  say("model_confirmed", 1);
  live(2s);
  EXPECT_EQ(model().reason, "by a command, and of no fluid") << "though it holds the very bits";
}

TEST_F(ModelSenderTest, AModelInDoubtLeavesARobotUnsurerThatIsSoAlready) {
  station::FluidModel doubted = some_model();
  doubted.assumed_because = "no linear model holds";
  models.put("water", doubted);
  held["model_section_error"] = 0.5F;
  begin();
  name_fluid("water");
  live(5s);
  EXPECT_THAT(sent, Not(Contains("model_confirmed")));
  EXPECT_EQ(held["model_section_error"], 0.5F);
  EXPECT_TRUE(holds_water());
}

TEST_F(ModelSenderTest, OfParametersThatHoldOnlyTheConfirmationIsSent) {
  for (const auto& [name, value] : parameters_of(some_model())) held[name] = value;
  begin();
  name_fluid("water");
  live(2s);
  EXPECT_THAT(sent, ElementsAre("model_confirmed"));
  EXPECT_EQ(model().state, station::ModelState::confirmed);
}

// SAFETY's test: what is read back, and not what was sent, is confirmed.
TEST_F(ModelSenderTest, AValueThatComesBackOtherwiseIsNeverConfirmed) {
  bends["model_gain_2_m_s"] = std::nextafter(-0.5F, 0.0F);
  begin();
  name_fluid("water");
  live(10s);
  EXPECT_THAT(sent, Not(Contains("model_confirmed")));
  EXPECT_EQ(model().state, station::ModelState::failed);
  EXPECT_THAT(model().reason, HasSubstr("model_gain_2_m_s = -0.5 was sent, and the robot holds -0.49999997"));
  EXPECT_THAT(events(), ElementsAre("model_not_confirmed"));
  EXPECT_THAT(latest_detail(), HasSubstr("the model of 'water' could not be sent"));
}

TEST_F(ModelSenderTest, WhatTelemetryDoesNotShowIsNotConfirmed) {
  hides_flag = true;
  begin();
  name_fluid("water");
  live(8s);
  EXPECT_EQ(model().state, station::ModelState::failed);
  EXPECT_THAT(model().reason, HasSubstr("telemetry does not show it"));
}

TEST_F(ModelSenderTest, ARobotThatMovesIsWaitedForAndThenGivenUp) {
  begin();
  mode = rheonaut_MODE_AUTO;
  duty = 0.5F;
  live(200ms);
  name_fluid("water");
  live(10s);
  EXPECT_EQ(model().state, station::ModelState::sending);
  EXPECT_EQ(refused, 0) << "nothing is sent to a robot that is seen to move";
  mode = rheonaut_MODE_MANUAL;
  duty = 0;
  is_coasting = true;
  live(3s);
  EXPECT_GT(refused, 0);
  is_coasting = false;
  live(5s);
  EXPECT_EQ(model().state, station::ModelState::confirmed);

  models.put("water", some_model(0.5F));
  duty = 0.1F;
  live(200ms);
  name_fluid("water");
  live(station::ModelExchange::kPatience + 1s);
  EXPECT_EQ(model().state, station::ModelState::failed);
  EXPECT_THAT(model().reason, HasSubstr("the motor is on"));
  duty = 0;
  live(10s);
  EXPECT_EQ(held["model_confirmed"], 0) << "the model that it holds is no longer that of the fluid";
}

TEST_F(ModelSenderTest, ARobotThatIsAwayIsNotSentAModelLater) {
  begin();
  robot->link.cut();
  clock.run_for(1s);
  name_fluid("water");
  EXPECT_EQ(model().state, station::ModelState::failed);
  EXPECT_EQ(model().reason, "the robot was not connected; name the fluid again");
  begin(77, seq);
  live(5s);
  EXPECT_THAT(sent, IsEmpty());
}

TEST_F(ModelSenderTest, AfterABootTheModelIsAssumedUntilTheFluidIsNamedAgain) {
  begin();
  name_fluid("water");
  live(5s);
  ASSERT_EQ(model().state, station::ModelState::confirmed);
  robot->link.cut();
  clock.run_for(1s);
  EXPECT_EQ(model().state, station::ModelState::confirmed) << "it may be back in the same boot";
  held["model_confirmed"] = 0;
  begin(78);
  live(2s);
  EXPECT_EQ(model().state, station::ModelState::assumed);
  EXPECT_EQ(model().reason, "the robot has booted: name its fluid again");
  const std::size_t before = sent.size();
  live(5s);
  EXPECT_EQ(sent.size(), before);
  name_fluid("water");
  live(2s);
  EXPECT_EQ(sent.back(), "model_confirmed");
  EXPECT_EQ(model().state, station::ModelState::confirmed);
}

TEST_F(ModelSenderTest, TheFluidThatIsNamedLastCounts) {
  models.put("non_newtonian", some_model(0.75F));
  begin();
  name_fluid("water");
  live(250ms);
  ASSERT_FALSE(sent.empty());
  name_fluid("non_newtonian");
  live(5s);
  EXPECT_EQ(model().fluid, "non_newtonian");
  EXPECT_EQ(model().state, station::ModelState::confirmed);
  EXPECT_EQ(held["model_gain_1_m_s"], 0.75F);
  EXPECT_THAT(events(), ElementsAre("model_confirmed"));
}

TEST_F(ModelSenderTest, WhoIsNotInControlSendsNothing) {
  begin();
  ASSERT_TRUE(station.control({"r1", "session:1", "", station::ControlAction::take, 60s, ""}));
  EXPECT_FALSE(station.set_fluid("r1", "water", {"session:2", "", 0}));
  live(2s);
  name_fluid("water", "session:1");
  live(250ms);
  const std::size_t before = sent.size();
  ASSERT_GT(before, 0U);
  ASSERT_TRUE(station.control({"r1", "session:3", "", station::ControlAction::force, 60s, "a test"}));
  live(5s);
  EXPECT_EQ(model().state, station::ModelState::failed);
  EXPECT_THAT(model().reason, HasSubstr("controlled by session:3"));
  ASSERT_TRUE(station.control({"r1", "session:3", "", station::ControlAction::take, 60s, ""}));
  const station::RobotModel now = model();
  ASSERT_TRUE(station.set_fluid("r1", "water", {"session:2", "", 0})) << "no change";
  live(2s);
  EXPECT_EQ(model(), now);
}

TEST_F(ModelSenderTest, TakesNoControlForTheActorThatNamedTheFluid) {
  begin();
  is_coasting = true;
  name_fluid("water", "user:anna");
  live(3s);
  EXPECT_GT(refused, 0);
  EXPECT_EQ(station.find("r1")->control.holder, "");
  is_coasting = false;
  live(5s);
  EXPECT_EQ(model().state, station::ModelState::confirmed);
  EXPECT_EQ(station.find("r1")->control.holder, "");
}

// SAFETY's test: while the sender waits for rest, somebody else may change what it has sent.
TEST_F(ModelSenderTest, WhatIsChangedWhileTheConfirmationWaitsIsNotConfirmed) {
  for (const auto& [name, value] : parameters_of(some_model())) held[name] = value;
  begin();
  is_coasting = true;
  name_fluid("water");
  live(300ms);
  ASSERT_EQ(refused, 1) << "the confirmation";
  is_coasting = false;
  change("model_gain_1_m_s", 0.3F);
  live(5s);
  EXPECT_THAT(sent, Not(Contains("model_confirmed")));
  EXPECT_EQ(model().state, station::ModelState::failed);
  EXPECT_THAT(model().reason, HasSubstr("somebody else changed one"));
}

class FailingModelTest : public ModelSenderFixture {
 protected:
  FailingModelTest() { station.add_sink(failing); }
  void expect_contained() {
    EXPECT_EQ(tasks.exceptions().count(runtime::Ended::model), 1U);
    EXPECT_TRUE(log.has("the model of robot 'r1': no room for it")) << log.text();
    EXPECT_EQ(tasks.exit_code(), 0);
    EXPECT_FALSE(tasks.stopping());
  }

  CapturedLog log;
  FailsOnce failing;
};

TEST_F(FailingModelTest, AFaultWhileTheModelIsSentFailsThatModelAlone) {
  begin();
  failing.at_command = true;
  name_fluid("water");
  live(1s);
  expect_contained();
  EXPECT_EQ(model().state, station::ModelState::failed);
  EXPECT_EQ(model().reason, "a fault of the station; its log says which");
  EXPECT_THAT(events(), ElementsAre("model_not_confirmed"));
  name_fluid("water");
  live(5s);
  EXPECT_EQ(model().state, station::ModelState::confirmed) << model().reason;
}

TEST_F(FailingModelTest, AFaultAtItsEndStopsNothing) {
  begin();
  failing.at_confirmed = true;
  name_fluid("water");
  live(5s);
  expect_contained();
  name_fluid("");
  live(5s);
  EXPECT_EQ(model().state, station::ModelState::assumed) << "it goes on with the next fluid";
}

TEST_F(FailingModelTest, AFaultWhileWhatTheRobotReportsIsFollowedStopsNothing) {
  for (const auto& [name, value] : parameters_of(some_model())) held[name] = value;
  held["model_confirmed"] = 1;
  station.restore({{.id = "r1", .boot_id = 77, .fluid = "water"}}, {});
  failing.at_confirmed = true;
  begin();
  live(2s);
  expect_contained();
  held["model_confirmed"] = 0;
  live(1s);
  EXPECT_EQ(model().state, station::ModelState::assumed) << "it goes on to follow";
}

}  // namespace
}  // namespace server
