// Prints how often a measured position is within the band predicted for it: prediction_study [SEEDS [FIRST [PROFILE
// [DUTY_MIN]]]]. Four fluids of tests/sim_robot/identification_trial.hpp; what a trial is: prediction_trial.hpp.
#include <cstdio>
#include <cstdlib>
#include <span>
#include <string>

#include "tests/server/experiments/prediction_trial.hpp"
#include "tests/sim_robot/identification_trial.hpp"

namespace {

using server::experiments::BandTally;

constexpr std::size_t kFluids = 4;

void print(const char* name, const BandTally& tally) {
  std::printf("| %s | %.1f %% | %.1f %% | %.3f | %.3f | %.2f | %.3f |", name, 100 * tally.share_within_before(),
              100 * tally.share_within(), 1e3 * tally.rms_m(), 1e3 * tally.half_width_rms_m(),
              tally.half_width_rms_m() / tally.rms_m(), 1e3 * tally.half_width_median_m());
  for (std::size_t part = 0; part < 4; ++part) std::printf(" %.3f |", 1e3 * tally.part_rms_m(part));
  std::printf(" %.1f %% | %.1f | %.1f |\n", 100 * tally.share_true_within(), 1e3 * tally.true_rms_m(),
              1e3 * tally.true_half_width_rms_m());
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  const int seeds = argc > 1 ? std::atoi(argv[1]) : 5, first = argc > 2 ? std::atoi(argv[2]) : 1;
  const std::string profile = argc > 3 ? argv[3] : "figure_7";
  const float duty_min = argc > 4 ? std::strtof(argv[4], nullptr) : -1;
  if (seeds < 1 || first < 1) return std::fprintf(stderr, "prediction_study: give positive numbers\n"), 2;
  std::printf(
      "| kp, b1, b2, alpha, beta (%d seeds from %d, %s) | within, parameters alone | within 2 sd | rms mm | 2 sd, rms "
      "mm "
      "| ratio | 2 sd, median mm | parameters mm | estimator mm | sensor mm | start mm | true within | true rms mm | "
      "true 2 sd, rms mm |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
      seeds, first, profile.c_str());
  BandTally all;
  for (const auto& fluid : std::span{sim_robot::kStudyFluids}.first(kFluids)) {
    BandTally of_fluid;
    for (int seed = first; seed < first + seeds; ++seed) {
      of_fluid.add(server::experiments::run_of({fluid, static_cast<std::uint64_t>(seed), profile, {duty_min, 1}}));
    }
    char name[80];
    std::snprintf(name, sizeof name, "%g, %g, %g, %g, %g", fluid.kp, fluid.b1, fluid.b2, fluid.alpha, fluid.beta);
    print(name, of_fluid);
    all.add(of_fluid);
  }
  print("all", all);
  return 0;
}
