// Predictions against the responses and the closed loop of control/.
#include "server/experiments/preview.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "control/responses/closed_loop.hpp"
#include "control/responses/time_response.hpp"
#include "server/experiments/profile_document.hpp"
#include "tests/server/experiments/steps.hpp"

namespace server::experiments {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// A proportional controller, which needs no discretisation.
control::ParallelSections gain(double kp) {
  control::ParallelSections sections;
  sections.direct = kp;
  return sections;
}

Preview previewed(const Profile& profile, const control::ParallelSections& controller) {
  return preview_of(profile, time_line_of(profile, {}), control::kNonNewtonianModel, controller);
}

TEST(Preview, AStepOfTheDutyIsTheStepResponse) {
  const Profile profile = find_profile("figure_5");
  const Preview preview = previewed(profile, gain(1));
  const std::vector<double> after_s{5};
  const control::TimeResponse response = control::step_response(control::kNonNewtonianModel, 0.3, after_s);
  EXPECT_NEAR(preview.position_m.at(600), response.position_m[0], 1e-6);
  EXPECT_NEAR(preview.position_m.at(600), 0.1457, 1e-4) << "as the paper's Figure 5";
  EXPECT_EQ(preview.duty.at(99), 0);
  EXPECT_EQ(preview.duty.at(100), 0.3);
  EXPECT_EQ(preview.duty.back(), 0);
  EXPECT_TRUE(std::isnan(preview.setpoint_m.at(100))) << "there is none in manual";
  EXPECT_THAT(preview.problems, IsEmpty());
  EXPECT_EQ(preview.time_s.size(), 801U);
}

TEST(Preview, AClosedLoopIsThatOfPredict) {
  const Profile profile = find_profile("figure_7");
  const Preview preview = previewed(profile, gain(10));
  control::ClosedLoopExperiment experiment;
  experiment.plant = control::kNonNewtonianModel;
  experiment.controller = gain(10);
  const control::ClosedLoopPrediction predicted = control::predict_closed_loop(experiment);
  ASSERT_EQ(preview.position_m.size(), predicted.position_m.size());
  for (std::size_t k = 0; k < predicted.position_m.size(); ++k) {
    ASSERT_NEAR(preview.position_m[k], predicted.position_m[k], 1e-12) << k;
    ASSERT_NEAR(preview.duty[k], predicted.duty[k], 1e-12) << k;
  }
}

TEST(Preview, ProblemsNameTheBoundTheTimeAndTheStep) {
  Profile profile = find_profile("figure_5");
  profile.limits.position_max_m = 0.1;
  profile.abort.position_max_m = 0.12;
  profile.steps[1].duty = 0.95;
  profile.abort.power_s = 2;
  const Preview preview = previewed(profile, gain(1));
  EXPECT_THAT(preview.problems,
              ElementsAre(HasSubstr("passes limits.position_max_m (0.1 m) after 2."), HasSubstr("in step 2 (duty)"),
                          HasSubstr("the duty is beyond 0.9 for 5.0 s, abort.power_s is 2 s")));
  EXPECT_GT(preview.position_max_m, 0.4);
  EXPECT_NEAR(preview.travel_m, preview.position_max_m, 1e-9) << "it never turns back";
}

TEST(Preview, ALoopThatDivergesEndsAndIsAProblem) {
  const Profile profile = find_profile("figure_7");
  const Preview preview =
      preview_of(profile, time_line_of(profile, {}), control::kNonNewtonianModel, gain(1e7), -1e6, 1e6);
  EXPECT_LT(preview.time_s.size(), 4001U);
  EXPECT_FALSE(preview.problems.empty());
}

TEST(Preview, AutoThenManualThenAutoBeginsFromRest) {
  Profile profile;
  profile.steps = {setpoint_step(0.1, 5), duty_step(-0.2, 3), setpoint_step(0.1, 10)};
  const Preview preview = previewed(profile, gain(10));
  EXPECT_EQ(preview.duty.at(501), 0) << "at rest while the mode changes";
  EXPECT_EQ(preview.duty.at(551), -0.2);
  EXPECT_NEAR(preview.position_m.back(), 0.1, 2e-3);
}

}  // namespace
}  // namespace server::experiments
