// A short record may need fewer parameters than the model has: the optimum lies at a bound, and the search ends there.
#include <gtest/gtest.h>

#include "control/search/descent.hpp"
#include "fluid_family.hpp"
#include "recorded_runs.hpp"

namespace control {
namespace {

// By a camera with 0.5 mm. Each start of these used to creep towards a bound until its iterations were used up.
TEST(ShortRecords, ASearchWhoseOptimumLiesAtABoundConverges) {
  const auto fluids = fluid_family(12, 77);
  struct Run {
    std::size_t fluid;
    double duration_s;
    unsigned seed;
  };
  for (const auto& [fluid, duration_s, seed] : {Run{0, 3, 2}, Run{8, 6.2, 2}, Run{11, 7.4, 2}}) {
    const Recording run = position_run(fluids[fluid], step_duty(0.3, duration_s, 0.01), 5e-4, seed);
    IdentificationOptions options = unhurried_options();
    options.structure = Structure::fractional;
    const Fit fit = identify(run, options).best;
    EXPECT_EQ(fit.end, SearchEnd::converged) << fluid << " after " << fit.iterations;
    EXPECT_GE(fit.starts_that_agree, 2) << fluid;
    EXPECT_NEAR(fit.residual_sd / 5e-4, 1, 0.05) << fluid;
  }
}

TEST(ShortRecords, StartsAgreeWhoseCostsTheDataCannotTellApart) {
  EXPECT_TRUE(costs_agree(1 + 1e-4, 1, 300));
  EXPECT_FALSE(costs_agree(1 + 1e-3, 1, 300));
  EXPECT_FALSE(costs_agree(1 + 1e-4, 1, 3000));
  EXPECT_TRUE(costs_agree(1 + 1e-6, 1, 1e6));
}

}  // namespace
}  // namespace control
