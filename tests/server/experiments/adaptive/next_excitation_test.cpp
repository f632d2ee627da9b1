// Which run is chosen next, and what it promises, against the information of each choice.
#include "server/experiments/adaptive/next_excitation.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/server/experiments/steps.hpp"

namespace server::experiments {
namespace {

using ::testing::HasSubstr;

Step prbs_step(double amplitude, double bit_s) {
  Step step = step_of(StepKind::prbs, 20);
  step.amplitude = amplitude;
  step.bit_s = bit_s;
  return step;
}

Profile until_alpha(std::vector<Step> steps) {
  Profile profile;
  profile.until = Until{3, 0.02};
  profile.most_runs = 4;
  profile.steps = std::move(steps);
  return profile;
}

Known known(std::optional<double> sigma = {}) { return {control::kNonNewtonianModel, sigma, 0.05}; }

NextExcitation chosen(const Profile& profile, const std::vector<Variant>& done, const Known& known) {
  std::vector<Candidate> candidates;
  for (const Variant& variant : variants_of(profile)) candidates.push_back(candidate_of(profile, variant, known));
  return next_excitation(profile, done, known, candidates);
}

TEST(NextExcitation, IsTheOneThatPromisesMost) {
  const Profile profile = until_alpha({duty_step(0.1, 20), prbs_step(0.2, 0.2), prbs_step(0.6, 0.2)});
  const NextExcitation found = chosen(profile, {}, known());
  ASSERT_TRUE(found.next);
  EXPECT_EQ(found.next->step, 3U) << "nine times the power of the second one";
  ASSERT_EQ(found.promises.size(), 3U);
  EXPECT_NEAR(*found.promises[1].sigma / *found.promises[2].sigma, 3, 1e-6);
  EXPECT_LT(*found.reachable_sigma, *found.promised_sigma / 2) << "four runs of it, and what the others tell";
}

// What excites the robot where nothing did so far may tell more than the same once more.
TEST(NextExcitation, LooksAtWhatWasDone) {
  const Profile profile = until_alpha({prbs_step(0.6, 0.1), prbs_step(0.6, 1)});
  const std::vector<Variant> all = variants_of(profile);
  const NextExcitation again = chosen(profile, {all[1], all[1], all[1]}, known());
  const NextExcitation first = chosen(profile, {}, known());
  EXPECT_LT(*again.promised_sigma, *first.promised_sigma);
  EXPECT_LT(*again.promises[1].sigma, *first.promises[1].sigma / 1.9) << "four runs of it in place of one";
}

TEST(NextExcitation, WhatLeavesTheLimitsIsNotChosen) {
  Profile profile = until_alpha({prbs_step(0.2, 0.2), duty_step(0.6, 20)});
  profile.limits.position_max_m = 0.3;
  profile.limits.position_min_m = -0.3;
  const NextExcitation found = chosen(profile, {}, known());
  ASSERT_TRUE(found.next);
  EXPECT_EQ(found.next->step, 1U);
  EXPECT_THAT(found.promises[1].forbidden, HasSubstr("limits.position_max_m"));
  EXPECT_THAT(found.promises[1].forbidden, HasSubstr("in step 2 (duty)"));
  profile.steps = {duty_step(0.6, 20)};
  const NextExcitation none = chosen(profile, {}, known());
  EXPECT_FALSE(none.next);
  EXPECT_FALSE(none.reachable_sigma);
}

TEST(NextExcitation, TheLatestFitScalesWhatIsPromised) {
  const Profile profile = until_alpha({prbs_step(0.6, 0.2)});
  const std::vector<Variant> done = variants_of(profile);
  const NextExcitation found = chosen(profile, done, known(0.08));
  EXPECT_NEAR(*found.promised_sigma, 0.08 / std::sqrt(2), 1e-6) << "twice the data";
  EXPECT_NEAR(*found.reachable_sigma, 0.08 / 2, 1e-6) << "three more runs";
}

}  // namespace
}  // namespace server::experiments
