// A confirmation does not outlive the fluid that it was made for: it is judged, and taken back.
#include <gmock/gmock.h>

#include "tests/server/station/models/model_fixture.hpp"

namespace server {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

class ModelConfirmationTest : public ModelSenderFixture {};

// SAFETY's test: a confirmation does not outlive the fluid that it was made for.
TEST_F(ModelConfirmationTest, AFluidWithoutAModelOrNoneTakesTheConfirmationBack) {
  begin();
  for (const char* next : {"non_newtonian", ""}) {
    name_fluid("water");
    live(5s);
    ASSERT_EQ(held["model_confirmed"], 1);
    name_fluid(next);
    live(2s);
    EXPECT_EQ(held["model_confirmed"], 0);
    EXPECT_EQ(model().state, station::ModelState::assumed);
    EXPECT_EQ(events().back(), "model_taken_back");
  }
  const std::size_t before = sent.size();
  name_fluid("non_newtonian");
  live(2s);
  EXPECT_EQ(sent.size(), before) << "there is nothing to take back";
  EXPECT_EQ(model().reason, "there is no model of 'non_newtonian'");
}

TEST_F(ModelConfirmationTest, WhatCouldNotBeTakenBackWhileTheRobotMovedIsTakenBackAtRest) {
  begin();
  name_fluid("water");
  live(5s);
  duty = 0.5F;
  live(200ms);
  name_fluid("non_newtonian");
  live(station::ModelExchange::kPatience + 20s);
  EXPECT_EQ(model().state, station::ModelState::failed);
  is_coasting = true;  // and says so
  duty = 0;
  live(2 * (station::ModelExchange::kPatience + station::ModelSender::kRetryInterval) + 5s);
  EXPECT_EQ(held["model_confirmed"], 1);
  const auto kinds = events();
  EXPECT_EQ(std::count(kinds.begin(), kinds.end(), "model_not_taken_back"), 2) << "a retry is no news";
  EXPECT_THAT(latest_detail(), HasSubstr("is not taken back yet: the motor is on, or the robot coasts"));
  is_coasting = false;
  live(10s);
  EXPECT_EQ(held["model_confirmed"], 0);
  EXPECT_EQ(model().state, station::ModelState::assumed);
}

TEST_F(ModelConfirmationTest, WhatWasNamedWhileTheRobotWasAwayIsTakenBackWhenItReturns) {
  begin();
  name_fluid("water");
  live(5s);
  robot->link.cut();
  clock.run_for(1s);
  ASSERT_FALSE(connected());
  name_fluid("non_newtonian");
  begin(77, seq);
  live(10s);
  EXPECT_EQ(held["model_confirmed"], 0);
  EXPECT_EQ(model().state, station::ModelState::assumed);
}

// SAFETY's test: the robot had taken the confirmation when the link broke, and nobody has seen it.
TEST_F(ModelConfirmationTest, AConfirmationThatWasOnItsWayWhenTheLinkBrokeIsTakenBack) {
  breaks_after_confirming = true;
  begin();
  name_fluid("water");
  live(3s);
  ASSERT_FALSE(connected());
  ASSERT_EQ(held["model_confirmed"], 1);
  EXPECT_EQ(model().state, station::ModelState::failed);
  name_fluid("non_newtonian");
  clock.run_for(3s);
  breaks_after_confirming = false;
  begin(77, seq);
  live(10s);
  EXPECT_EQ(held["model_confirmed"], 0);
  EXPECT_EQ(model().state, station::ModelState::assumed);
}

TEST_F(ModelConfirmationTest, WhatTheRobotTakesBackByItselfIsAssumed) {
  begin();
  name_fluid("water");
  live(5s);
  held["model_gain_1_m_s"] = 1;  // by somebody's command
  held["model_confirmed"] = 0;
  say("model_gain_1_m_s", 1);
  live(1s);
  EXPECT_EQ(model().state, station::ModelState::assumed);
  EXPECT_THAT(model().reason, HasSubstr("a parameter was changed"));
  held["model_confirmed"] = 1;  // likewise
  live(1s);
  EXPECT_EQ(model().state, station::ModelState::confirmed);
  EXPECT_EQ(model().fluid, "") << "of no fluid that the station knows";
}

TEST_F(ModelConfirmationTest, OtherBitsUnderAFlagThatNoSampleShowedFallingAreNoLongerTheFluidsModel) {
  begin();
  name_fluid("water");
  live(3s);
  ASSERT_EQ(model(), (station::RobotModel{station::ModelState::confirmed, "water", "", 0.002, some_model().set_at_us}));
  held["model_gain_1_m_s"] = 0.3F;  // and confirmed again, before the next sample
  say("model_gain_1_m_s", 0.3F);
  live(500ms);
  EXPECT_NE(model().fluid, "water");
}

// A page comes before the sample that shows what the change has done to the confirmation.
TEST_F(ModelConfirmationTest, AChangedParameterIsNoConfirmationBySomebodyElse) {
  begin();
  name_fluid("water");
  live(3s);
  change("model_gain_3_m_s", 0.3F);
  clock.settle();
  EXPECT_EQ(model().state, station::ModelState::assumed) << "the link may break now";
  live(2s);
  EXPECT_EQ(model().state, station::ModelState::assumed);
  EXPECT_THAT(model().reason, HasSubstr("a parameter was changed"));
  const auto is_of_no_fluid = [](const station::RobotState& one) {
    return one.model.state == station::ModelState::confirmed && one.model.fluid.empty();
  };
  EXPECT_EQ(std::count_if(sink.robots.begin(), sink.robots.end(), is_of_no_fluid), 0);
}

TEST_F(ModelConfirmationTest, AParameterThatIsChangedAfterTheLinkReturnedEndsTheConfirmation) {
  begin();
  name_fluid("water");
  live(3s);
  come_back();
  EXPECT_EQ(model().fluid, "water");
  change("model_gain_1_m_s", 0.3F);
  live(2s);
  EXPECT_EQ(model().state, station::ModelState::assumed);
  EXPECT_EQ(model().fluid, "");
}

// SAFETY's test: the same, and confirmed again while the link was cut. Nothing is sent while another is in control.
TEST_F(ModelConfirmationTest, OtherBitsOfARobotThatReturnsConfirmedAreNotTheFluidsModel) {
  begin();
  name_fluid("water");
  live(3s);
  ASSERT_TRUE(station.control({"r1", "session:1", "", station::ControlAction::take, 20s, ""}));
  held["model_gain_1_m_s"] = 0.3F;
  come_back();
  live(2s);
  EXPECT_EQ(model().state, station::ModelState::failed);
  EXPECT_EQ(model().reason, "what was confirmed before is not taken back yet");
  EXPECT_EQ(held["model_confirmed"], 1);
  live(30s);
  EXPECT_EQ(held["model_confirmed"], 0);
  EXPECT_EQ(model().state, station::ModelState::assumed);
}

// SAFETY's test: no sample shows the flag falling.
TEST_F(ModelConfirmationTest, OtherBitsUnderAConfirmationThatTheStationOnlyJudgedAreTakenBack) {
  for (const auto& [name, value] : parameters_of(some_model())) held[name] = value;
  held["model_confirmed"] = 1;
  station.restore({{.id = "r1", .boot_id = 77, .fluid = "water"}}, {});
  begin();
  live(2s);
  ASSERT_EQ(model().fluid, "water");
  held["model_gain_1_m_s"] = 0.3F;
  say("model_gain_1_m_s", 0.3F);
  live(500ms);
  EXPECT_EQ(model().fluid, "");
  live(10s);
  EXPECT_EQ(held["model_confirmed"], 0);
  EXPECT_EQ(model().state, station::ModelState::assumed);
}

TEST_F(ModelConfirmationTest, AfterARestartOfTheStationAConfirmationStandsForTheModelOfTheNamedFluidAlone) {
  for (const auto& [name, value] : parameters_of(some_model())) held[name] = value;
  held["model_confirmed"] = 1;
  station.restore({{.id = "r1", .boot_id = 77, .fluid = "water"}}, {});
  begin();
  live(2s);
  EXPECT_EQ(model().state, station::ModelState::confirmed);
  EXPECT_EQ(model().fluid, "water");
  EXPECT_THAT(sent, IsEmpty());
}

// SAFETY's test: nobody knows for which fluid it was made.
TEST_F(ModelConfirmationTest, AConfirmationThatTheStationHasNotSeenBeingMadeIsTakenBack) {
  held["model_confirmed"] = 1;
  station.restore({{.id = "r1", .boot_id = 77, .fluid = "water"}}, {});
  begin();
  ASSERT_TRUE(station.control({"r1", "session:1", "", station::ControlAction::take, 10s, ""}));
  live(5s);
  EXPECT_EQ(held["model_confirmed"], 1) << "while somebody is in control nothing is sent";
  live(10s);
  EXPECT_EQ(held["model_confirmed"], 0);
  EXPECT_EQ(sink.commands.back().actor, "station:model");
  EXPECT_EQ(model().state, station::ModelState::assumed);
}

}  // namespace
}  // namespace server
