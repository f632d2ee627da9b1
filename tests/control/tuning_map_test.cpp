// The map of what can be asked of a controller: its numbers are those of the tuner, and each empty point has its
// reason.
#include "control/tuning/tuning_map.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "control/tuning/tune.hpp"

namespace control {
namespace {

TuningMapSpec between(double from_rad_s, double to_rad_s, int points) { return {from_rad_s, to_rad_s, points, false}; }

// What was computed independently for the paper's plant: the margins at 1, 3, 5 and 6.5 rad/s.
TEST(TuningMap, HasTheKnownMarginsOfThePapersPlant) {
  struct Known {
    double omega_rad_s, low_deg, high_deg;
  };
  for (const auto& [omega_rad_s, low_deg, high_deg] :
       {Known{1, 89.22, 168.40}, Known{3, 88.61, 149.16}, Known{5, 90.01, 129.58}, Known{6.5, 95.83, 110.75}}) {
    const auto map = tuning_map(kNonNewtonianModel, between(omega_rad_s, 2 * omega_rad_s, 2));
    ASSERT_EQ(map.front().ranges.size(), 1U) << omega_rad_s;
    EXPECT_NEAR(map.front().ranges[0].low_deg, low_deg, 0.01) << omega_rad_s;
    EXPECT_NEAR(map.front().ranges[0].high_deg, high_deg, 0.01) << omega_rad_s;
    EXPECT_EQ(map.front().reason, MapReason::feasible);
  }
}

TEST(TuningMap, SaysWhyACrossoverHasNone) {
  for (const TuningMapPoint& point : tuning_map(kNonNewtonianModel, between(7, 57, 20))) {
    EXPECT_TRUE(point.ranges.empty());
    EXPECT_EQ(point.reason, MapReason::phase_falls_too_fast) << point.gain_crossover_rad_s;
    EXPECT_GT(point.phase_fall, 0.5);
  }
  const FractionalModel late{0.1, 0.005, 0.1, 1, 1.95, 0.9, 1e-4};  // at 3000 rad/s the phase is below -270 degrees
  EXPECT_EQ(tuning_map(late, between(3000, 3100, 2)).front().reason, MapReason::margin_below_0);
  const FractionalModel resonant{0.1, 0.01, 0.005, 1, 2, 1, 0};  // below its resonance the phase falls late, and fast
  EXPECT_EQ(tuning_map(resonant, {4, 5, 2, true}).front().reason, MapReason::margin_above_180);
  const FractionalModel oscillating{0.4, 0.01, 0.02, 1, 1.9, 0.5, 0};  // crosses over again further up
  const auto map = tuning_map(oscillating, between(0.5, 12, 24));
  EXPECT_TRUE(std::ranges::any_of(map, [](const auto& point) { return point.reason == MapReason::not_sound; }));
}

TEST(TuningMap, TheTunerAgreesWithEveryPoint) {
  for (const TuningMapPoint& point : tuning_map(kNonNewtonianModel, between(0.5, 80, 12))) {
    TuningSpec spec;
    spec.gain_crossover_rad_s = point.gain_crossover_rad_s;
    for (const PhaseMarginRange& range : point.ranges) {
      spec.phase_margin_deg = (range.low_deg + range.high_deg) / 2;
      EXPECT_TRUE(tune(kNonNewtonianModel, spec).is_feasible) << point.gain_crossover_rad_s;
    }
    spec.phase_margin_deg = 60;  // below what any crossover of this plant has below 57 rad/s
    if (point.gain_crossover_rad_s < 57) EXPECT_FALSE(tune(kNonNewtonianModel, spec).is_feasible);
  }
}

TEST(TuningMap, BothEndsBelongToItAndItsStepsAreRatios) {
  const auto map = tuning_map(kNonNewtonianModel, between(1, 16, 5));
  ASSERT_EQ(map.size(), 5U);
  for (std::size_t i = 0; i < map.size(); ++i) EXPECT_NEAR(map[i].gain_crossover_rad_s, 1 << i, 1e-9);
}

TEST(TuningMap, EndsWhereItIsTold) {
  std::vector<double> shares;
  const auto map = tuning_map(kNonNewtonianModel, between(1, 16, 10), [&shares](double share) {
    shares.push_back(share);
    return share < 0.3;
  });
  EXPECT_EQ(map.size(), 3U);
  EXPECT_NEAR(shares.back(), 0.3, 1e-12);
}

TEST(TuningMap, RefusesWhatIsNoRange) {
  EXPECT_THROW(tuning_map(kNonNewtonianModel, between(2, 2, 10)), std::invalid_argument);
  EXPECT_THROW(tuning_map(kNonNewtonianModel, between(0, 2, 10)), std::invalid_argument);
  EXPECT_THROW(tuning_map(kNonNewtonianModel, between(1, 2, 1)), std::invalid_argument);
  EXPECT_THROW(tuning_map(kNonNewtonianModel, between(1, 2, kMostMapPoints + 1)), std::invalid_argument);
}

}  // namespace
}  // namespace control
