// A duty that stands one row beside its own is named, and what it costs the parameters; a duty that does not is not.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "recorded_runs.hpp"

namespace control {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

constexpr FractionalModel kTwoLags{0.1, 0.006, 0.11, 1, 2, 1};

enum class Shifted { not_at_all, too_late, too_early };

Recording run_with(Shifted shifted, unsigned seed) {
  Recording run = position_run(kTwoLags, prbs_duty(0.5, 0.2, 40, 0.01), 1e-4, seed);
  std::vector<double>& duty = run.duty;
  if (shifted == Shifted::too_late) std::copy_backward(duty.begin(), duty.end() - 1, duty.end());
  if (shifted == Shifted::too_early) std::copy(duty.begin() + 1, duty.end(), duty.begin());
  return run;
}

Identification with_first_start(Shifted shifted, unsigned seed) {
  IdentificationOptions options = unhurried_options();
  options.further_starts = 0;
  return identify(run_with(shifted, seed), options);
}

double sigmas_off(const Fit& fit) {
  const double b1 = std::abs(fit.model.b1 - kTwoLags.b1) / fit.one_sigma[1].value_or(1e300);
  const double b2 = std::abs(fit.model.b2 - kTwoLags.b2) / fit.one_sigma[2].value_or(1e300);
  return std::max(b1, b2);
}

TEST(ShiftedDuty, IsNamedEitherWay) {
  const Identification late = with_first_start(Shifted::too_late, 3);
  EXPECT_THAT(late.warnings, Contains(HasSubstr("with the duty one row earlier the model explains clearly more")));
  EXPECT_GT(sigmas_off(late.best), 5);
  const Identification early = with_first_start(Shifted::too_early, 3);
  EXPECT_THAT(early.warnings, Contains(HasSubstr("with the duty one row later the model explains clearly more")));
  EXPECT_GT(sigmas_off(early.best), 5);
  RecordProperty("late_sigmas", std::to_string(sigmas_off(late.best)));
  RecordProperty("late_b1_percent", std::to_string(100 * (late.best.model.b1 / kTwoLags.b1 - 1)));
  RecordProperty("early_sigmas", std::to_string(sigmas_off(early.best)));
  RecordProperty("early_b1_percent", std::to_string(100 * (early.best.model.b1 / kTwoLags.b1 - 1)));
}

TEST(ShiftedDuty, IsNotNamedWhereTheDutyStandsRight) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    EXPECT_THAT(with_first_start(Shifted::not_at_all, seed).warnings,
                Not(Contains(HasSubstr("with the duty one row"))));
  }
}

}  // namespace
}  // namespace control
