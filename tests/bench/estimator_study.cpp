// Prints the estimator's seeds study as the table of docs/robot.md: estimator_study [SEEDS].
#include <cstdio>
#include <cstdlib>

#include "tests/robot_fw/estimator_trial.hpp"

int main(int argc, char** argv) {
  const int seeds = argc > 1 ? std::atoi(argv[1]) : 100;
  if (seeds < 1) return std::fprintf(stderr, "estimator_study: SEEDS '%s' is not a positive number\n", argv[1]), 2;
  std::printf(
      "| case, %d seeds | 95 %% mm | rms mm | sd mm | within 2 sd | all seconds | target 95 %% mm | mismatch s |\n",
      seeds);
  std::printf("|---|---|---|---|---|---|---|---|\n");
  for (const auto& [name, trial, expected] : robot_fw::study_trials()) {
    const auto row = robot_fw::run_study(trial, seeds);
    std::printf("| %s | %.1f | %.1f | %.1f | %.0f %% | %.0f %% | ", name, 1e3 * row.error_95_m, 1e3 * row.error_rms_m,
                1e3 * row.sd_m, 100 * row.share_within, 100 * row.seconds_within);
    if (trial.closed_loop) std::printf("%.1f", 1e3 * row.target_95_m);
    std::printf(" | ");
    if (row.mismatches > 0) {
      std::printf("%d of %d: %.2f to %.2f", row.mismatches, seeds, row.mismatch_first_s, row.mismatch_last_s);
    }
    std::printf(" |\n");
  }
  return 0;
}
