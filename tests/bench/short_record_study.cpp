// Prints how the searches on short records end: short_record_study [RECORDS].
//
// Steps, pulses and binary duties of 3 to 8 s in drawn fluids, by the default sensor and by a camera with 0.5 mm.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <random>

#include "tests/control/fluid_family.hpp"
#include "tests/sim_robot/identification_trial.hpp"

namespace {

constexpr double kCameraSdM = 5e-4;

std::vector<double> duty_of(int number, double duration_s) {
  if (number % 2 == 1) {
    std::vector<double> duty = control::prbs_duty(0.6, 0.5, duration_s, 0.01);
    if (number % 4 == 1) std::ranges::replace(duty, -0.6, 0.1);
    return duty;
  }
  std::vector<double> duty(static_cast<std::size_t>(100 * duration_s), 0.0);
  std::fill(duty.begin() + (number % 4 == 0 ? 100 : 0), duty.end(), 0.3 + 0.1 * (number % 3));
  if (number % 8 == 2) std::fill(duty.begin() + 200, duty.end(), 0.0);
  return duty;
}

void study(const char* name, int records, bool is_camera) {
  const auto fluids = control::fluid_family(records, 77);
  std::mt19937 random{5};
  int searches = 0, at_limit = 0, best_at_limit = 0, iterations = 0;
  double took_s = 0;
  for (int i = 0; i < records; ++i) {
    const double duration_s = std::uniform_real_distribution{3.0, 8.0}(random);
    const sim_robot::IdentificationTrial trial{fluids[static_cast<std::size_t>(i)], false, duty_of(i, duration_s)};
    const auto seed = static_cast<std::uint64_t>(900 + i);
    const auto recording = is_camera ? record_position(trial, kCameraSdM, seed) : record(trial, seed);
    control::IdentificationOptions options;
    options.time_limit_s = 1e6;
    const auto begun = std::chrono::steady_clock::now();
    const control::Identification found = control::identify(recording, options);
    took_s += std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
    for (const control::Fit& fit : found.compared) {
      ++searches;
      at_limit += fit.end == control::SearchEnd::iteration_limit ? 1 : 0;
      iterations += fit.iterations;
    }
    best_at_limit += found.best.end == control::SearchEnd::iteration_limit ? 1 : 0;
  }
  std::printf("| %s | %d of %d | %d of %d | %.1f | %.2f s |\n", name, at_limit, searches, best_at_limit, records,
              static_cast<double>(iterations) / searches, took_s / records);
}

}  // namespace

int main(int argc, char** argv) {
  const int records = argc > 1 ? std::atoi(argv[1]) : 40;
  if (records < 1) return std::fprintf(stderr, "short_record_study: RECORDS '%s' is no positive number\n", argv[1]), 2;
  std::printf("| sensor | searches at the iteration limit | of the best | iterations | time of a record |\n");
  std::printf("|---|---|---|---|---|\n");
  study("default, acceleration", records, false);
  study("camera, position", records, true);
  return 0;
}
