// The seeds study of docs/robot.md with fewer seeds and some room: what the estimator is held to.
#include <gtest/gtest.h>

#include <cctype>
#include <ostream>
#include <string>

#include "tests/robot_fw/estimator_trial.hpp"

namespace robot_fw {

// In the test's name.
static void PrintTo(const NamedTrial& trial, std::ostream* out) { *out << trial.name; }

namespace {

constexpr int kSeeds = 20;  // the fewest of which 95 % are not all

class EstimatorStudy : public ::testing::TestWithParam<NamedTrial> {};

TEST_P(EstimatorStudy, IsNearTheTruthAndNeverConfidentlyWrong) {
  const auto& [name, trial, expected] = GetParam();
  SCOPED_TRACE(name);
  const StudyRow row = run_study(trial, kSeeds);
  EXPECT_GE(row.share_within, 0.9);
  EXPECT_GE(row.seconds_within, 0.85);
  if (expected.within_5_mm) {
    EXPECT_LE(row.error_95_m, 0.006);
    if (trial.closed_loop) EXPECT_LE(row.target_95_m, 0.006);
  }
  if (expected.mismatch == Mismatch::never) EXPECT_EQ(row.mismatches, 0);
  if (expected.mismatch == Mismatch::always) {
    EXPECT_EQ(row.mismatches, kSeeds);
    EXPECT_LE(row.mismatch_last_s, 5);
  }
}

INSTANTIATE_TEST_SUITE_P(Cases, EstimatorStudy, ::testing::ValuesIn(study_trials()), [](const auto& instance) {
  std::string name;
  for (const char* c = instance.param.name; *c != '\0'; ++c) {
    if (std::isalnum(static_cast<unsigned char>(*c))) name += *c;
  }
  return name + std::to_string(instance.index);
});

TEST(EstimatorTrial, IsTheSameForTheSameSeedAndAnotherForAnother) {
  const EstimatorTrial trial;
  EXPECT_EQ(run_trial(trial, 3).estimate_error_m, run_trial(trial, 3).estimate_error_m);
  EXPECT_NE(run_trial(trial, 3).estimate_error_m, run_trial(trial, 4).estimate_error_m);
}

}  // namespace
}  // namespace robot_fw
