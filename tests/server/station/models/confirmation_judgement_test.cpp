// Which confirmation stands: by what a robot reports, and by what was sent to it.
#include "server/station/models/confirmation_judgement.hpp"

#include <gtest/gtest.h>

#include "tests/server/station/models/reported_parameters.hpp"

namespace server {
namespace {

constexpr std::int64_t kLongAfterUs = 60'000'000;

class ConfirmationJudgementTest : public ::testing::Test {
 protected:
  ConfirmationJudgementTest() {
    robot.boot_id = 7;
    robot.next_seq = 100;
    values["model_confirmed"] = 1;
  }

  void is_held_for_confirmed(const std::string& fluid) {
    robot.model.state = station::ModelState::confirmed;
    robot.model.fluid = fluid;
    if (!fluid.empty()) sent = water;
  }
  station::Finding finding(std::int64_t now_us = kLongAfterUs) { return judgement(now_us).finding; }
  station::Judgement judgement(std::int64_t now_us = kLongAfterUs) {
    return judge(robot, seen, table_of(values), sent, model, now_us);
  }

  const station::FluidModel water = some_model();
  station::RobotState robot;
  station::ObservedConfirmation seen;
  std::map<std::string, float> values = values_of(water);
  std::optional<station::FluidModel> sent;
  const station::FluidModel* model = &water;  // of the fluid that is named
};

TEST_F(ConfirmationJudgementTest, AConfirmationOfWhatWasSentStands) {
  is_held_for_confirmed("water");
  seen.on_flag(7, true, 0);
  EXPECT_EQ(finding(), station::Finding::nothing_new);
  EXPECT_FALSE(judgement().is_open);
}

TEST_F(ConfirmationJudgementTest, AFlagThatFallsTakesTheConfirmationBack) {
  is_held_for_confirmed("water");
  seen.on_flag(7, false, 0);
  EXPECT_EQ(finding(), station::Finding::taken_back);
  robot.model = {};
  EXPECT_EQ(finding(), station::Finding::nothing_new) << "nothing was held for confirmed";
}

TEST_F(ConfirmationJudgementTest, APageWithAnotherValueTakesItBackBeforeTheNextSample) {
  is_held_for_confirmed("water");
  seen.on_flag(7, true, 0);
  values["model_gain_1_m_s"] = 0.3F;
  seen.on_page(100, kLongAfterUs);
  EXPECT_EQ(finding(), station::Finding::taken_back);
  EXPECT_TRUE(judgement().is_open) << "the sample after the page says whether it was confirmed again";
}

TEST_F(ConfirmationJudgementTest, AConfirmationIsNotJudgedBeforeTheSampleThatFollowsItsPage) {
  seen.on_flag(7, true, 0);
  seen.on_page(100, kLongAfterUs);
  EXPECT_EQ(finding(), station::Finding::nothing_new);
  EXPECT_TRUE(judgement().is_open);
  robot.next_seq = 101;
  EXPECT_EQ(finding(), station::Finding::model_of_fluid);
}

TEST_F(ConfirmationJudgementTest, AConfirmationFromElsewhereStandsForTheModelOfTheNamedFluid) {
  seen.on_flag(7, true, 0);
  EXPECT_EQ(finding(), station::Finding::model_of_fluid);
}

TEST_F(ConfirmationJudgementTest, AConfirmationThatWasSeenToRiseIsSomebodysCommand) {
  seen.on_flag(7, false, 0);
  seen.on_flag(7, true, 1);
  values["model_gain_1_m_s"] = 0.3F;
  EXPECT_EQ(finding(), station::Finding::by_command);
  model = nullptr;
  EXPECT_EQ(finding(), station::Finding::by_command);
}

// SAFETY's test: nobody knows for which fluid it was made.
TEST_F(ConfirmationJudgementTest, AnyOtherConfirmationIsOfUnknownOrigin) {
  seen.on_flag(7, true, 0);
  values["model_gain_1_m_s"] = 0.3F;
  EXPECT_EQ(finding(), station::Finding::of_unknown_origin);
  values = values_of(water);
  model = nullptr;
  EXPECT_EQ(finding(), station::Finding::of_unknown_origin) << "a fluid without a model";
}

// SAFETY's test: the flag fell and rose again between two samples.
TEST_F(ConfirmationJudgementTest, OtherBitsUnderAConfirmationThatStoodAreOfUnknownOrigin) {
  is_held_for_confirmed("water");
  seen.on_flag(7, true, 0);
  values["model_gain_1_m_s"] = 0.3F;
  EXPECT_EQ(finding(), station::Finding::of_unknown_origin);
}

TEST_F(ConfirmationJudgementTest, ParametersThatHaveNotBeenReportedAreWaitedForFiveSeconds) {
  seen.on_flag(7, true, kLongAfterUs);
  values.clear();
  EXPECT_EQ(finding(kLongAfterUs + 4'000'000), station::Finding::nothing_new);
  EXPECT_TRUE(judgement(kLongAfterUs + 4'000'000).is_open);
  EXPECT_EQ(finding(kLongAfterUs + 5'000'000), station::Finding::of_unknown_origin);
}

}  // namespace
}  // namespace server
