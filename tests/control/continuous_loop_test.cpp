// The ideal closed loop agrees with the reference inversions.
#include "control/continuous_loop.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "control/plant_models.hpp"

namespace control {
namespace {

constexpr double kSetpointM = 0.1, kRelative = 1e-9;

TEST(ContinuousLoop, FollowsTheReferenceResponses) {
  const auto golden = nlohmann::json::parse(std::ifstream(TEST_DATA_DIR "/closed_loop_cases.json"));
  for (const auto& row : golden["linear_continuous"]) {
    SCOPED_TRACE(row["plant"].get<std::string>());
    const ContinuousLoop loop{row["plant"] == "Eq(29)" ? kNonNewtonianModel : kNewtonianModel, kPaperController};
    for (std::size_t i = 0; i < row["t"].size(); ++i) {
      const double expected = row["y"][i];
      ASSERT_NEAR(kSetpointM * loop.position(row["t"][i]), expected, kRelative * expected) << row["t"][i];
    }
    const ContinuousStep step = measure_continuous_step(loop);
    EXPECT_NEAR(kSetpointM * step.peak, row["peak"], kRelative * kSetpointM);
    EXPECT_NEAR(step.peak_time_s, row["peak_time_s"], 1e-7);
    EXPECT_NEAR(step.overshoot_percent, row["overshoot_pct"], 1e-6);
    ASSERT_TRUE(step.settling_2_percent_s.has_value());
    EXPECT_NEAR(*step.settling_2_percent_s, row["settling_2pct_s"], 1e-8);
  }
}

TEST(ContinuousLoop, IsTheExponentialOfAFirstOrderLoop) {
  // Q = s (b2 s + b3) + K kp with b1 = 0, beta = 1: s² + 2 s + 1.
  const FractionalModel plant{1, 0, 1, 2, 2, 1};
  const ContinuousLoop loop{plant, {1, 0, 0.5}};
  for (const double t : {0.01, 0.1, 1.0, 5.0, 30.0}) {
    const double exact = 1 - (1 + t) * std::exp(-t);
    EXPECT_NEAR(loop.position(t), exact, 1e-11) << t;
    EXPECT_NEAR(loop.velocity(t), t * std::exp(-t), 1e-9) << t;
  }
  EXPECT_EQ(measure_continuous_step(loop).overshoot_percent, 0);
}

TEST(ContinuousLoop, SaysThatALoopIsUnstable) {
  // s³ + s² + s + kp is stable for kp < 1.
  const FractionalModel plant{1, 1, 1, 1, 2, 1};
  EXPECT_NO_THROW(ContinuousLoop(plant, {0.9, 0, 0.5}));
  EXPECT_THROW(ContinuousLoop(plant, {1.1, 0, 0.5}), std::invalid_argument);
  EXPECT_FALSE(measure_continuous_step(ContinuousLoop(plant, {0.9, 0, 0.5})).settling_2_percent_s.has_value());
}

}  // namespace
}  // namespace control
