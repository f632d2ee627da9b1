// The band of a prediction against what can be said exactly, and against predictions with parameters drawn at random.
#include "server/experiments/preview_band.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "server/experiments/profile_document.hpp"

namespace server::experiments {
namespace {

using control::kNonNewtonianModel;

control::ParallelSections proportional(double kp) {
  control::ParallelSections sections;
  sections.direct = kp;
  return sections;
}

class PreviewBand : public ::testing::Test {
 protected:
  std::vector<double> position_sd_m(const control::ParallelSections& controller) const {
    return parameters_sd_of(profile, line, kNonNewtonianModel, known, controller);
  }
  std::vector<double> position_m(const control::FractionalModel& model, const control::ParallelSections& controller) {
    return preview_of(profile, line, model, controller).position_m;
  }
  void use(const char* name) {
    profile = find_profile(name);
    line = time_line_of(profile, {});
  }

  Profile profile;
  TimeLine line;
  control::ExpectedUncertainty known;
};

TEST_F(PreviewBand, OfTheGainAloneIsInProportionToTheMotion) {
  use("figure_5");
  known.one_sigma[0] = 0.05 * kNonNewtonianModel.kp;
  const auto position = position_m(kNonNewtonianModel, proportional(1));
  const auto sd = position_sd_m(proportional(1));
  ASSERT_EQ(sd.size(), position.size());
  EXPECT_EQ(sd[50], 0) << "before the first duty";
  for (const std::size_t k : {150U, 400U, 800U}) EXPECT_NEAR(sd[k], 0.05 * position[k], 1e-9) << k;
}

TEST_F(PreviewBand, ParametersThatAreKnownTogetherAddUpByTheirCorrelation) {
  use("figure_5");
  known.one_sigma[0] = 0.001;
  known.one_sigma[2] = 0.001;
  const double apart = position_sd_m(proportional(1)).back();
  known.correlation[0][2] = known.correlation[2][0] = 1;
  const double together = position_sd_m(proportional(1)).back();
  known.correlation[0][2] = known.correlation[2][0] = -1;
  const double against = position_sd_m(proportional(1)).back();
  EXPECT_NEAR(together * together + against * against, 2 * apart * apart, 1e-12);
  EXPECT_NE(together, against);
}

// 400 models drawn from the normal distribution of the fit; the sd of their sd is 3.5 %.
TEST_F(PreviewBand, IsTheSpreadOfModelsDrawnAtRandomAlsoInAClosedLoop) {
  use("figure_7");
  known.one_sigma = {0.02 * kNonNewtonianModel.kp, 0.02 * kNonNewtonianModel.b1, 0.02 * kNonNewtonianModel.b2, 0.005,
                     0.005};
  const auto sd = position_sd_m(proportional(10));
  std::mt19937_64 random{7};
  std::normal_distribution<double> normal;
  constexpr std::size_t kModels = 400;
  const std::vector<std::size_t> at{50, 100, 200, 2050};
  std::vector<double> sum(at.size()), squares(at.size());
  for (std::size_t i = 0; i < kModels; ++i) {
    control::FractionalModel model = kNonNewtonianModel;
    model.kp += *known.one_sigma[0] * normal(random);
    model.b1 += *known.one_sigma[1] * normal(random);
    model.b2 += *known.one_sigma[2] * normal(random);
    model.alpha += *known.one_sigma[3] * normal(random);
    model.beta += *known.one_sigma[4] * normal(random);
    const auto position = position_m(model, proportional(10));
    for (std::size_t k = 0; k < at.size(); ++k) {
      sum[k] += position[at[k]];
      squares[k] += position[at[k]] * position[at[k]];
    }
  }
  for (std::size_t k = 0; k < at.size(); ++k) {
    const double mean = sum[k] / kModels, drawn = std::sqrt(squares[k] / kModels - mean * mean);
    EXPECT_NEAR(sd[at[k]], drawn, 0.15 * drawn) << "after " << at[k] << " ticks";
  }
}

TEST_F(PreviewBand, AtTheEdgeOfWhatAModelMayBeTheOtherSideCounts) {
  use("figure_5");
  control::FractionalModel edge = kNonNewtonianModel;
  edge.beta = 1;
  known.one_sigma[4] = 0.01;
  const auto sd = parameters_sd_of(profile, line, edge, known, proportional(1));
  EXPECT_GT(sd.back(), 0);
  EXPECT_TRUE(std::ranges::all_of(sd, [](double each) { return std::isfinite(each); }));
}

// To first order the position of a later plant is the one of that time before.
TEST_F(PreviewBand, OfADeadTimeItIsTheWayOfThatTime) {
  use("figure_5");
  constexpr std::size_t kTicks = 3;
  known.dead_time_sd_s = kTicks * kTick_s;
  const auto position = position_m(kNonNewtonianModel, proportional(1));
  const auto sd = position_sd_m(proportional(1));
  for (const std::size_t k : {130U, 150U, 200U}) {
    ASSERT_GT(position[k] - position[k - kTicks], 2e-4) << k;
    EXPECT_NEAR(sd[k], position[k] - position[k - kTicks], 1e-9) << k;
  }
}

TEST_F(PreviewBand, OfADeadTimeAndParametersTheSquaresAddUp) {
  use("figure_7");
  known.one_sigma[0] = 0.02 * kNonNewtonianModel.kp;
  const auto of_gain = position_sd_m(proportional(10));
  known.dead_time_sd_s = 0.01;
  const auto of_both = position_sd_m(proportional(10));
  known.one_sigma[0] = 0;
  const auto of_dead_time = position_sd_m(proportional(10));
  ASSERT_GT(of_dead_time[50], 1e-4);
  for (const std::size_t k : {50U, 100U, 200U}) {
    EXPECT_NEAR(of_both[k], std::hypot(of_gain[k], of_dead_time[k]), 1e-12) << k;
  }
}

TEST_F(PreviewBand, OfAKnownModelIsZero) {
  use("figure_5");
  EXPECT_EQ(std::ranges::max(position_sd_m(proportional(1))), 0);
}

TEST_F(PreviewBand, IsMadeOfFourPartsWhoseSquaresAddUp) {
  use("figure_7");
  known.one_sigma[0] = 0.02 * kNonNewtonianModel.kp;
  const BandRequest request{
      profile, line, kNonNewtonianModel, known, proportional(10), {}, estimate_with(kNonNewtonianModel, false)};
  const PositionBand band = band_of(request);
  const std::size_t samples = position_m(kNonNewtonianModel, proportional(10)).size();
  EXPECT_EQ(band.parameters_m, position_sd_m(proportional(10)));
  for (const auto* part :
       {&band.sd_m, &band.parameters_m, &band.estimator_m, &band.sensor_m, &band.start_m, &band.true_sd_m}) {
    ASSERT_EQ(part->size(), samples);
    EXPECT_TRUE(std::ranges::all_of(*part, [](double each) { return std::isfinite(each) && each >= 0; }));
  }
  for (const std::size_t k : {50U, 200U, 2050U, 4000U}) {
    EXPECT_NEAR(band.sd_m[k],
                std::hypot(std::hypot(band.parameters_m[k], band.estimator_m[k]),
                           std::hypot(band.sensor_m[k], band.start_m[k])),
                1e-12)
        << k;
  }
  EXPECT_LT(band.sd_m.back(), 5e-5) << "the loop holds the position that it measures";
  EXPECT_GT(band.true_sd_m.back(), 1e-3) << "and with it the error of the estimate";
}

TEST_F(PreviewBand, IsWiderWhereTheRobotsModelIsOnlyAssumed) {
  use("figure_7");
  BandRequest request{
      profile, line, kNonNewtonianModel, known, proportional(10), {}, estimate_with(kNonNewtonianModel, false)};
  const PositionBand confirmed = band_of(request);
  request.estimate.is_confirmed = false;
  const PositionBand assumed = band_of(request);
  EXPECT_GT(assumed.estimator_m[100], 10 * confirmed.estimator_m[100]);
  EXPECT_GT(assumed.true_sd_m.back(), 3 * confirmed.true_sd_m.back());
}

// With duty in [0, 0.2] all of the way to 0.1 m is clipped at 0.2: nothing but the gain decides how far it comes.
TEST_F(PreviewBand, HasTheDutyRangeOfTheController) {
  use("figure_7");
  known.one_sigma[0] = 0.02 * kNonNewtonianModel.kp;
  const DutyRange narrow{0, 0.2};
  const auto sd = parameters_sd_of(profile, line, kNonNewtonianModel, known, proportional(100), narrow);
  const auto clipped = preview_of(profile, line, kNonNewtonianModel, proportional(100), narrow.min, narrow.max);
  for (const std::size_t k : {50U, 100U, 150U}) EXPECT_NEAR(sd[k], 0.02 * clipped.position_m[k], 1e-9) << k;
}

}  // namespace
}  // namespace server::experiments
