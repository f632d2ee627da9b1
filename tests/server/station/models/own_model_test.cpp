// A model that is sent to one robot alone: how long it stands, and what takes it back.
#include <gmock/gmock.h>

#include "tests/server/station/models/model_fixture.hpp"

namespace server {
namespace {

using station::ModelState;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class AuditSink final : public station::StationSink {
 public:
  void on_audit(const station::AuditNote& note) override { last = note; }
  station::AuditNote last;
};

class OwnModelTest : public ModelSenderFixture {
 protected:
  OwnModelTest() { station.add_sink(audit); }

  // Newer than the list's.
  static station::FluidModel own_model() { return some_model(0.3F); }
  bool holds_own() const { return held.at("model_gain_1_m_s") == 0.3F && held.at("model_confirmed") == 1; }

  AuditSink audit;
};

TEST_F(OwnModelTest, IsSentReadBackAndConfirmedForTheFluidThatIsNamed) {
  begin();
  name_fluid("non_newtonian");
  live(1s);
  send_own(own_model());
  EXPECT_EQ(model().state, ModelState::sending);
  live(5s);
  EXPECT_TRUE(holds_own());
  EXPECT_EQ(model().state, ModelState::confirmed) << model().reason;
  EXPECT_EQ(model().fluid, "non_newtonian");
  EXPECT_EQ(model().reason, "sent to this robot alone");
  EXPECT_EQ(latest_detail(), "its own model of non_newtonian by token:local");
  EXPECT_EQ(models.find("non_newtonian"), nullptr) << "no other robot gets it";
}

TEST_F(OwnModelTest, StandsWhenARunNamesTheSameFluidAgain) {
  begin();
  name_fluid("water");
  live(3s);
  send_own(own_model());
  live(5s);
  ASSERT_TRUE(holds_own());
  sent.clear();
  name_fluid("water");
  live(5s);
  EXPECT_THAT(sent, IsEmpty());
  EXPECT_TRUE(holds_own());
  EXPECT_EQ(model().state, ModelState::confirmed);
}

TEST_F(OwnModelTest, StandsWhenTheLinkReturnsInTheSameBoot) {
  begin();
  name_fluid("water");
  send_own(own_model());
  live(5s);
  come_back();
  name_fluid("water");
  live(10s);
  EXPECT_TRUE(holds_own());
  EXPECT_EQ(model().reason, "sent to this robot alone");
}

// SAFETY's test: it was found in the fluid before.
TEST_F(OwnModelTest, IsTakenBackWhenAnotherFluidIsNamedAndNeverComesBack) {
  begin();
  name_fluid("water");
  send_own(own_model());
  live(5s);
  ASSERT_TRUE(holds_own());
  for (const char* other : {"non_newtonian", ""}) {
    name_fluid(other);
    live(10s);
    EXPECT_EQ(held["model_confirmed"], 0) << other;
    EXPECT_EQ(model().state, ModelState::assumed) << other;
  }
  name_fluid("water");
  live(10s);
  EXPECT_TRUE(holds_water()) << "the list's";
}

// SAFETY's test: nobody says that the robot is in the fluid of the model.
TEST_F(OwnModelTest, OfAnotherFluidThanTheOneThatIsNamedIsRefused) {
  begin();
  const station::Author by{"token:local", "", clock.utc_us()};
  const auto unnamed = station.send_model("r1", "water", own_model(), by);
  ASSERT_FALSE(unnamed);
  EXPECT_EQ(unnamed.error().reason, "other_fluid");
  EXPECT_THAT(unnamed.error().detail, HasSubstr("robot 'r1' is in a fluid that nobody has named"));
  name_fluid("non_newtonian");
  EXPECT_THAT(station.send_model("r1", "water", own_model(), by).error().detail, HasSubstr("is in 'non_newtonian'"));
  EXPECT_EQ(station.send_model("r1", "treacle", own_model(), by).error().reason, "unknown_fluid");
  live(2s);
  EXPECT_THAT(sent, IsEmpty());
}

TEST_F(OwnModelTest, EndsWithABoot) {
  begin();
  name_fluid("water");
  send_own(own_model());
  live(5s);
  ASSERT_TRUE(holds_own());
  robot->link.cut();
  clock.run_for(1s);
  held["model_confirmed"] = 0;
  begin(78);
  live(1s);
  EXPECT_EQ(model().reason, "the robot has booted: name its fluid again");
  held["model_confirmed"] = 1;  // by somebody's command
  live(2s);
  ASSERT_EQ(model().state, ModelState::confirmed);
  name_fluid("water");
  live(5s);
  EXPECT_TRUE(holds_water()) << "the fluid's model, as the list has it";
}

// SAFETY's test: no sample shows the flag falling.
TEST_F(OwnModelTest, OtherBitsUnderItsConfirmationAreTakenBack) {
  begin();
  name_fluid("non_newtonian");
  send_own(own_model());
  live(5s);
  ASSERT_EQ(model().state, ModelState::confirmed);
  held["model_gain_1_m_s"] = 0.4F;
  say("model_gain_1_m_s", 0.4F);
  live(500ms);
  EXPECT_EQ(model().fluid, "");
  live(20s);
  EXPECT_FALSE(held["model_confirmed"] == 1 && model().fluid == "non_newtonian");
}

TEST_F(OwnModelTest, ThatIsConfirmedAgainByHandIsStillItself) {
  begin();
  name_fluid("non_newtonian");
  send_own(own_model());
  live(5s);
  held["model_confirmed"] = 0;
  live(1s);
  ASSERT_EQ(model().state, ModelState::assumed);
  held["model_confirmed"] = 1;
  live(1s);
  EXPECT_EQ(model().state, ModelState::confirmed);
  EXPECT_EQ(model().reason, "sent to this robot alone");
  EXPECT_EQ(model().fluid, "non_newtonian");
}

// SAFETY's test: nobody else sends, by naming a fluid, what this actor could not.
TEST_F(OwnModelTest, ThatDidNotArriveEndsWithTheRightOfItsSender) {
  begin();
  name_fluid("water");
  live(5s);
  ASSERT_EQ(held["model_confirmed"], 1) << "of the list's model";
  duty = 0.5F;
  live(500ms);
  send_own(own_model(), "token:old");
  live(40s);
  ASSERT_EQ(model().state, ModelState::failed);
  EXPECT_THAT(model().reason, HasSubstr("then send the model again"));
  sender.on_right_ended({[](const std::string& actor) { return actor == "token:old"; }, "revoked"});
  duty = 0;
  name_fluid("water");
  live(20s);
  EXPECT_TRUE(holds_water());
  EXPECT_NE(model().reason, "sent to this robot alone");
}

// SAFETY's test: the robot holds the list's bits as confirmed, and nobody with a right has sent them.
TEST_F(OwnModelTest, AConfirmationThatIsOnItsWayWhenTheRightEndsIsTakenBack) {
  begin();
  name_fluid("water", "token:old");
  for (int k = 0; k < 100 && held["model_confirmed"] == 0; ++k) live(50ms);
  ASSERT_TRUE(holds_water());
  ASSERT_EQ(model().state, ModelState::sending) << "the answer has not come";
  sender.on_right_ended({[](const std::string& actor) { return actor == "token:old"; }, "revoked"});
  duty = 0.5F;  // the robot takes nothing now
  live(40s);
  duty = 0;
  live(20s);
  EXPECT_EQ(held["model_confirmed"], 0);
  EXPECT_NE(model().state, ModelState::confirmed);
}

TEST_F(OwnModelTest, ThatTheRobotHoldsStandsWhenTheRightOfItsSenderEnds) {
  begin();
  name_fluid("water");
  send_own(own_model(), "token:old");
  live(5s);
  sender.on_right_ended({[](const std::string&) { return true; }, "revoked"});
  name_fluid("water");
  live(5s);
  EXPECT_TRUE(holds_own());
}

TEST_F(OwnModelTest, AFluidsModelThatWasSetAfterwardsTakesItsPlaceWhenTheFluidIsNamedAgain) {
  begin();
  name_fluid("water");
  send_own(own_model());
  live(5s);
  ASSERT_TRUE(holds_own());
  station::FluidModel changed = some_model();
  changed.set_at_us -= 1;  // the computer's clock was set back
  models.put("water", changed);
  name_fluid("water");
  live(5s);
  EXPECT_TRUE(holds_water());
  EXPECT_EQ(model().state, ModelState::confirmed);
  EXPECT_EQ(model().reason, "");
}

TEST_F(OwnModelTest, ThatBecomesTheFluidsIsTheFluidsFromTheNextNamingOn) {
  begin();
  name_fluid("non_newtonian");
  send_own(own_model());
  live(5s);
  sent.clear();
  models.put("non_newtonian", own_model());
  name_fluid("non_newtonian");
  live(2s);
  EXPECT_THAT(sent, IsEmpty());
  EXPECT_EQ(model().state, ModelState::confirmed);
  EXPECT_EQ(model().reason, "");
}

// SAFETY's test: the robot stays as unsure as without it.
TEST_F(OwnModelTest, OneInDoubtIsAssumed) {
  begin();
  name_fluid("water");
  live(5s);
  ASSERT_EQ(held["model_confirmed"], 1);
  station::FluidModel doubted = own_model();
  doubted.assumed_because = "no linear model holds";
  send_own(doubted);
  live(5s);
  EXPECT_EQ(held["model_confirmed"], 0);
  EXPECT_EQ(held["model_gain_1_m_s"], 0.3F);
  EXPECT_EQ(held["model_section_error"], station::kAssumedSectionError);
  EXPECT_EQ(model().state, ModelState::assumed);
  name_fluid("water");
  live(5s);
  EXPECT_EQ(held["model_confirmed"], 0) << "the doubt stands, too";
}

// SAFETY's test: it changes the estimate under the hands of who steers.
TEST_F(OwnModelTest, WhoMayNotCommandTheRobotSendsNone) {
  begin();
  ASSERT_TRUE(station.control({"r1", "session:1", "", station::ControlAction::take, 20s, ""}));
  name_fluid("water", "session:1");
  live(5s);
  sent.clear();
  const auto refused = station.send_model("r1", "water", own_model(), {"token:local", "", clock.utc_us()});
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().detail, HasSubstr("only who is in control sends it a model"));
  EXPECT_EQ(audit.last.action, "model.refused");
  robot->link.cut();
  clock.run_for(1s);
  EXPECT_EQ(station.send_model("r1", "water", own_model(), {"session:1", "", clock.utc_us()}).error().reason,
            "not_connected");
  EXPECT_EQ(station.send_model("r9", "water", own_model(), {"session:1", "", 0}).error().reason, "unknown_robot");
  EXPECT_THAT(sent, IsEmpty());
}

}  // namespace
}  // namespace server
