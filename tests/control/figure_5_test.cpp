// Figure 5: the response to a duty step of 0.3, and the model identified from it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "control/identification/identify.hpp"
#include "recorded_runs.hpp"
#include "tests/control/figures.hpp"

namespace control {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;

constexpr double kPaperResidualM = 1.16e-3;

TEST(Figure5, TheModelIsFoundAsFarAsTheRunCanTell) {
  const Recording run = position_run(kNonNewtonianModel, step_duty(0.3, 5, 0.01), kPaperResidualM, 5);
  const std::vector<double> truth = output_of(kNonNewtonianModel, Channel::position, 0.01, run.duty);
  IdentificationOptions options = unhurried_options();
  options.structure = Structure::fractional;
  const Identification found = identify(run, options);

  double sse_of_truth = 0, largest_m = 0;
  std::vector<double> model_m(truth.size());
  for (std::size_t k = 0; k < truth.size(); ++k) {
    model_m[k] = run.position_m[k] - found.best.position_residual_m[k];
    sse_of_truth += (run.position_m[k] - truth[k]) * (run.position_m[k] - truth[k]);
    largest_m = std::max(largest_m, std::abs(model_m[k] - truth[k]));
  }
  EXPECT_LE(found.best.sse, sse_of_truth);
  EXPECT_GT(found.best.sse, 0.97 * sse_of_truth);  // five parameters take about 5/501 of the noise with them
  EXPECT_LT(largest_m, 1.5e-3);
  EXPECT_NEAR(found.best.residual_sd, kPaperResidualM, 0.1 * kPaperResidualM);
  EXPECT_THAT(found.warnings, Contains(AllOf(HasSubstr("cannot determine"), HasSubstr("b1"), HasSubstr("alpha"),
                                             HasSubstr("±1 PRBS of 60 s"))));

  std::ofstream file(figure_path("figure_5.csv"));
  file << "t_s,duty,measured_m,model_m\n";
  for (std::size_t k = 0; k < truth.size(); ++k) {
    file << 0.01 * static_cast<double>(k) << ',' << run.duty[k] << ',' << run.position_m[k] << ',' << model_m[k]
         << '\n';
  }
  EXPECT_TRUE(file.good());
}

}  // namespace
}  // namespace control
