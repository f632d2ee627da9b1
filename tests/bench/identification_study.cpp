// Prints how well the fit of the acceleration finds five fluids: identification_study [SEEDS [FIRST]].
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>

#include "tests/sim_robot/identification_trial.hpp"

namespace {

struct Row {
  int responses = 0, parameters = 0, white = 0, clocks = 0;
  double worst_response = 0, worst_sigmas = 0, worst_sigma_by_bound = 0, worst_belief = 0, slowest_s = 0;
};

Row study(const control::FractionalModel& fluid, int seeds, int first) {
  Row row;
  for (int seed = first; seed < first + seeds; ++seed) {
    const auto number = static_cast<std::uint64_t>(seed);
    const auto recording = sim_robot::record({fluid, false, sim_robot::study_duty()}, number);
    const auto begun = std::chrono::steady_clock::now();
    const sim_robot::TrialFit found = sim_robot::fit_of(recording, fluid);
    const double took_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
    const auto other = sim_robot::record({fluid, true, sim_robot::study_duty()}, number);
    const double belief = sim_robot::worst_response_error(sim_robot::fit_of(other, fluid).fit.model, found.fit.model);
    row.responses += found.worst_response <= 0.02 ? 1 : 0;
    row.parameters += found.worst_sigmas <= 3 ? 1 : 0;
    row.white += found.fit.residuals_are_white ? 1 : 0;
    row.clocks += found.fit.sensor->has_own_clock ? 1 : 0;
    row.worst_response = std::max(row.worst_response, found.worst_response);
    row.worst_sigmas = std::max(row.worst_sigmas, found.worst_sigmas);
    row.worst_sigma_by_bound = std::max(row.worst_sigma_by_bound, found.worst_sigma_by_bound);
    row.worst_belief = std::max(row.worst_belief, belief);
    row.slowest_s = std::max(row.slowest_s, took_s);
  }
  return row;
}

}  // namespace

int main(int argc, char** argv) {
  const int seeds = argc > 1 ? std::atoi(argv[1]) : 40;
  const int first = argc > 2 ? std::atoi(argv[2]) : 1;
  if (seeds < 1) return std::fprintf(stderr, "identification_study: SEEDS '%s' is no positive number\n", argv[1]), 2;
  if (first < 1) return std::fprintf(stderr, "identification_study: FIRST '%s' is no positive number\n", argv[2]), 2;
  std::printf(
      "| kp, b1, b2, alpha, beta (%d seeds from %d) | response within 2 %% | worst | parameters within 3 sigma | worst "
      "| "
      "sigma by bound, worst | other belief, worst | white | own clock | slowest s |\n",
      seeds, first);
  std::printf("|---|---|---|---|---|---|---|---|---|---|\n");
  for (const auto& fluid : sim_robot::kStudyFluids) {
    const Row row = study(fluid, seeds, first);
    std::printf("| %g, %g, %g, %g, %g | %d | %.2f %% | %d | %.2f | %.2f | %.2f %% | %d | %d | %.2f |\n", fluid.kp,
                fluid.b1, fluid.b2, fluid.alpha, fluid.beta, row.responses, 100 * row.worst_response, row.parameters,
                row.worst_sigmas, row.worst_sigma_by_bound, 100 * row.worst_belief, row.white, row.clocks,
                row.slowest_s);
    std::fflush(stdout);
  }
  return 0;
}
