// The stages of autotune that bring the model to the robot, and to its fluid.
#include <gmock/gmock.h>

#include "tests/server/cli/autotune_fixture.hpp"

namespace server::cli {
namespace {

using ::testing::HasSubstr;

TEST_F(AutotuneTest, AModelThatTheRobotCannotUseIsNotSentAndSaysWhy) {
  station.estimator = {{"refused", "it overshoots"}, {"fit_error", 0.2}};
  options.json = true;
  ASSERT_EQ(tune(), 0) << progress.str();
  EXPECT_EQ(station.count(kRobotModel), 0);
  EXPECT_THAT(progress.str(), HasSubstr("robot model: not sent: it overshoots; the robot's position stays"));
  EXPECT_EQ(json::parse(out.str()).at("stages").at("robot_model").at("state"), "not_sent");
}

// SAFETY's test: a confirmation is for the fluid and the robot that the model was found with.
TEST_F(AutotuneTest, AModelOfAnotherFluidOrRobotIsNotSent) {
  const auto tuned_without = [&](const char* why) {
    ASSERT_EQ(tune(), 0) << progress.str();
    EXPECT_EQ(station.count(kRobotModel), 0) << why;
    EXPECT_THAT(progress.str(), HasSubstr(why));
  };
  station.run_fluid = "non_newtonian";
  tuned_without(R"(was recorded in the fluid "non_newtonian", and the robot is in "water")");
  station.run_fluid = station.robot_fluid = nullptr;
  tuned_without("--set FLUID says which, before the run");
  station.run_fluid = station.robot_fluid = "";
  tuned_without("--set FLUID says which, before the run");
  station.run_fluid = station.robot_fluid = "water";
  station.run_robot = "sim-2";
  tuned_without(R"(is of another robot, "sim-2")");
}

TEST_F(AutotuneTest, AModelOnItsWayIsWaitedForAndOneInDoubtIsSaidToBeAssumed) {
  station.sendings = 2;
  station.model_state = "assumed";
  station.model_reason = "sent as assumed only, since it is in doubt: no linear model holds";
  ASSERT_EQ(tune(), 0) << progress.str();
  EXPECT_EQ(station.count(kRobotModel), 1) << "it is sent once, and looked for";
  EXPECT_THAT(progress.str(), HasSubstr("robot model: assumed: sent as assumed only, since it is in doubt"));
  EXPECT_EQ(station.count(kFluidModel), 0) << "nobody said yes";
}

TEST_F(AutotuneTest, AModelThatDoesNotArriveEndsTheChainWhichGoesOnFromThere) {
  resume_from("tune.json");
  station.model_state = "failed";
  station.model_reason = "the motor is on";
  EXPECT_EQ(tune(), kStageEnded);
  EXPECT_THAT(progress.str(), HasSubstr("robot_model: failed: the motor is on"));
  station.model_state = "assumed";
  station.model_reason = "the robot has booted: name its fluid again";
  station.has_arrived = false;
  EXPECT_EQ(tune(), kStageEnded) << "it holds another one";
  station.has_arrived = true;
  station.model_state = "confirmed";
  station.experiment_ends[2] = "aborted";
  EXPECT_EQ(tune(), kStageEnded);
  station.experiment_ends.clear();
  EXPECT_EQ(tune(), 0) << progress.str();
  EXPECT_EQ(station.count(kRobotModel), 4) << "sent again before a verification: the robot may have booted";
  EXPECT_EQ(station.count(kPush), 1);
  EXPECT_EQ(tune(), 0);
  EXPECT_EQ(station.count(kRobotModel), 4) << "verified is verified";
}

TEST_F(AutotuneTest, TheFluidGetsTheModelOnAPersonsYesOnceAndOnlyIfTheRobotHasIt) {
  resume_from("tune.json");
  ASSERT_EQ(tune(), 0) << progress.str();
  EXPECT_EQ(station.count(kFluidModel), 0);
  options.request.stores_fluid_model = true;
  for (int i = 0; i < 2; ++i) ASSERT_EQ(tune(), 0) << progress.str();  // the yes may come afterwards
  EXPECT_EQ(station.count(kFluidModel), 1);
  EXPECT_EQ(station.body_of(kFluidModel), station.body_of(kRobotModel)["model"]);
  EXPECT_EQ(station.body_of(kRobotModel)["fluid"], "water");

  resume_from("other.json");
  options.request.stores_fluid_model = false;
  station.experiment_ends[4] = "aborted";
  ASSERT_EQ(tune(), kStageEnded) << "the robot has the model";
  options.request.stores_fluid_model = true;
  station.robot_fluid = "non_newtonian";  // and is put elsewhere before the command is given again
  EXPECT_EQ(tune(), kStageEnded);
  EXPECT_THAT(progress.str(), HasSubstr("fluid_model: the robot was not sent the model"));
  EXPECT_EQ(station.count(kFluidModel), 1);
}

}  // namespace
}  // namespace server::cli
