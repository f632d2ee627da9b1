// The phase margins that are called sound at a crossover are those that tune grants.
#include <gtest/gtest.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "control/tuning/tune.hpp"
#include "control/tuning/tuning_alternatives.hpp"

namespace control {
namespace {

bool are_in(const std::vector<PhaseMarginRange>& ranges, double margin_deg) {
  return std::ranges::any_of(ranges, [margin_deg](const PhaseMarginRange& range) {
    return range.low_deg < margin_deg && margin_deg < range.high_deg;
  });
}

// At the margin that was asked for, and just inside the ends of each range.
TEST(SoundMargins, AreThoseThatTuneGrants) {
  const FractionalModel resonant{0.4, 0.01, 0.02, 1, 1.9, 0.5};
  int granted = 0, refused = 0;
  const std::vector<std::pair<FractionalModel, double>> plants{{resonant, 2}, {resonant, 5}, {kNonNewtonianModel, 0.5}};
  for (const auto& [plant, omega_rad_s] : plants) {
    for (double margin_deg = 5; margin_deg < 180; margin_deg += 19) {
      SCOPED_TRACE(testing::Message() << omega_rad_s << " rad/s, " << margin_deg << " degrees");
      const TuningSpec spec{omega_rad_s, margin_deg};
      const TuningResult result = tune(plant, spec);
      const auto ranges = sound_phase_margins(plant, spec);
      EXPECT_EQ(are_in(ranges, margin_deg), result.is_feasible);
      granted += result.is_feasible;
      refused += result.refused.has_value();
      for (const PhaseMarginRange& range : ranges) {
        EXPECT_GE(range.low_deg, 0);
        EXPECT_LE(range.high_deg, 180);
        const double inside_deg = (range.high_deg - range.low_deg) / 1e4;
        EXPECT_TRUE(tune(plant, {omega_rad_s, range.low_deg + inside_deg}).is_feasible);
        EXPECT_TRUE(tune(plant, {omega_rad_s, range.high_deg - inside_deg}).is_feasible);
      }
    }
  }
  EXPECT_GT(granted, 2);
  EXPECT_GT(refused, 2);
  const auto of_paper = sound_phase_margins(kNonNewtonianModel, {5, 91, 0.9});
  const auto solved = feasible_phase_margins(kNonNewtonianModel, 5);
  ASSERT_EQ(of_paper.size(), 1U);
  EXPECT_EQ(of_paper[0].low_deg, solved->low_deg);
  EXPECT_EQ(of_paper[0].high_deg, solved->high_deg);
  EXPECT_TRUE(sound_phase_margins(kNonNewtonianModel, {20, 72}).empty());
}

}  // namespace
}  // namespace control
