// Prints how well the robot knows its position in fluids whose model it has: fluid_study [FLUIDS] [SEEDS]; in how
// many fluids four sections make a model: fluid_study models; or how well it knows it without a model of the fluid, in
// each second of Figure 7's loop: fluid_study first_seconds [FLUIDS] [SEEDS] [DRAW]; and under duties by hand that are
// faster than the fluid: fluid_study by_hand [FLUIDS] [SEEDS] [DRAW].
//
// Figure 7's loop on the estimate, default sensor, the model of control/discretisation/estimator_model, confirmed.
// Fluids are drawn as in tests/control/fluid_family.hpp until so many have a model; those that have none are counted.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <vector>

#include "control/discretisation/estimator_model.hpp"
#include "control/responses/time_response.hpp"
#include "tests/control/fluid_family.hpp"
#include "tests/robot_fw/estimator_trial.hpp"

namespace {

struct Tally {
  int trials = 0, ends_within = 0, ends_within_10_mm = 0, sds_to_7_mm = 0, fluids = 0, fluids_within = 0;
  double seconds_within = 0, largest_error_m = 0, largest_sd_m = 0;

  void add(const Tally& other) {
    trials += other.trials;
    ends_within += other.ends_within;
    ends_within_10_mm += other.ends_within_10_mm;
    sds_to_7_mm += other.sds_to_7_mm;
    seconds_within += other.seconds_within;
    largest_error_m = std::max(largest_error_m, other.largest_error_m);
    largest_sd_m = std::max(largest_sd_m, other.largest_sd_m);
    ++fluids;
    if (other.ends_within == other.trials) ++fluids_within;
  }
};

Tally study(const control::FractionalModel& fluid, const control::EstimatorModel& model, int seeds) {
  robot_fw::EstimatorTrial trial;
  trial.truth = fluid;
  trial.estimator.model = {model.sections.gain_m_s, model.sections.time_constant_s};
  trial.closed_loop = true;
  trial.disturbance_m = -0.05;
  Tally tally;
  for (int seed = 1; seed <= seeds; ++seed) {
    const auto result = robot_fw::run_trial(trial, static_cast<std::uint64_t>(seed));
    const double error_m = std::abs(result.estimate_error_m);
    ++tally.trials;
    tally.seconds_within += result.share_within;
    if (error_m <= 2 * result.position_sd_m) ++tally.ends_within;
    if (error_m <= 0.01) ++tally.ends_within_10_mm;
    if (result.position_sd_m <= 0.007) ++tally.sds_to_7_mm;
    tally.largest_error_m = std::max(tally.largest_error_m, error_m);
    tally.largest_sd_m = std::max(tally.largest_sd_m, result.position_sd_m);
  }
  return tally;
}

void print(const Tally& tally) {
  std::printf(
      "%d of %d fluids within 2 sd at the end of every trial, %.1f %% of seconds, %.1f %% of ends; "
      "at most 10 mm off in %.1f %%, sd at most 7 mm in %.1f %% (largest %.1f mm, sd %.1f mm)\n",
      tally.fluids_within, tally.fluids, 100 * tally.seconds_within / std::max(tally.trials, 1),
      100.0 * tally.ends_within / std::max(tally.trials, 1),
      100.0 * tally.ends_within_10_mm / std::max(tally.trials, 1),
      100.0 * tally.sds_to_7_mm / std::max(tally.trials, 1), 1e3 * tally.largest_error_m, 1e3 * tally.largest_sd_m);
}

// Without a model of the fluid.
void print_first_seconds(int fluids, int seeds, unsigned draw) {
  std::ptrdiff_t seconds_below = 0, fluids_below = 0;
  double within = 0, least = 1;
  for (const control::FractionalModel& fluid : control::fluid_family(fluids, draw)) {
    const auto shares = robot_fw::shares_within(robot_fw::figure_7_in(fluid), seeds);
    for (const double share : shares) within += share / static_cast<double>(shares.size()) / fluids;
    const auto below = std::ranges::count_if(shares, [](double share) { return share < 0.8 - 1e-9; });
    seconds_below += below;
    fluids_below += below > 0 ? 1 : 0;
    least = std::min(least, std::ranges::min(shares));
  }
  std::printf(
      "%d fluids, draw %u, %d seeds: %.2f %% of seconds within 2 sd; the least second %.0f %%; below 80 %%: "
      "%td seconds in %td fluids\n",
      fluids, draw, seeds, 100 * within, 100 * least, seconds_below, fluids_below);
}

// Of all seconds of some fluids' trials, and the worst of these fluids.
void print_by_hand(const char* name, const std::vector<control::FractionalModel>& fluids, int seeds,
                   const std::function<robot_fw::DutyByHand(std::uint64_t)>& duty) {
  double squares_m2 = 0, worst_rms_m = 0, least = 1, flow_s = 0, duration_s = 0;
  std::ptrdiff_t within = 0;
  std::vector<double> sds_m;
  for (const control::FractionalModel& fluid : fluids) {
    double fluids_squares_m2 = 0;
    std::ptrdiff_t fluids_within = 0, seconds = 0;
    for (int seed = 1; seed <= seeds; ++seed) {
      auto trial = robot_fw::figure_7_in(fluid);
      trial.by_hand = duty(static_cast<std::uint64_t>(seed));
      const auto result = robot_fw::run_trial(trial, static_cast<std::uint64_t>(seed));
      for (std::size_t i = 0; i < result.errors_m.size(); ++i, ++seconds) {
        fluids_squares_m2 += result.errors_m[i] * result.errors_m[i];
        fluids_within += std::abs(result.errors_m[i]) <= 2 * result.sds_m[i] ? 1 : 0;
        sds_m.push_back(result.sds_m[i]);
      }
      flow_s += result.flow_s;
      duration_s += trial.duration_s;
    }
    worst_rms_m = std::max(worst_rms_m, std::sqrt(fluids_squares_m2 / static_cast<double>(seconds)));
    least = std::min(least, static_cast<double>(fluids_within) / static_cast<double>(seconds));
    squares_m2 += fluids_squares_m2;
    within += fluids_within;
  }
  const auto count = static_cast<double>(sds_m.size());
  std::ranges::nth_element(sds_m, sds_m.begin() + std::ssize(sds_m) / 2);
  std::printf("| %s | %.1f %%, least of a fluid %.1f %% | %.0f, most of a fluid %.0f | %.0f | %.1f %% |\n", name,
              100 * static_cast<double>(within) / count, 100 * least, 1e3 * std::sqrt(squares_m2 / count),
              1e3 * worst_rms_m, 1e3 * sds_m[sds_m.size() / 2], 100 * flow_s / duration_s);
}

void print_by_hand(int fluids, int seeds, unsigned draw) {
  const auto family = control::fluid_family(fluids, draw);
  const auto in_turn = [](std::uint64_t) -> robot_fw::DutyByHand {
    return [](long tick) { return tick > 3000 ? 0 : tick / 30 % 2 == 0 ? 0.1F : 0.7F; };
  };
  const auto at_random = [](std::uint64_t seed) { return robot_fw::duties_at_random(-1, 1, seed); };
  const auto forwards = [](std::uint64_t seed) { return robot_fw::duties_at_random(0, 1, seed); };
  std::printf(
      "| %d fluids, draw %u, %d seeds | within 2 sd | rms error mm | median sd mm | of the time a flow is suspected "
      "|\n|---|---|---|---|---|\n",
      fluids, draw, seeds);
  print_by_hand("at random in [-1, 1], each for 0.03 to 1 s", family, seeds, at_random);
  print_by_hand("at random in [0, 1], each for 0.03 to 1 s", family, seeds, forwards);
  print_by_hand("0.1 and 0.7 in turn, each for 0.3 s", family, seeds, in_turn);
  print_by_hand("(29) itself, at random in [-1, 1]", {control::kNonNewtonianModel}, 10 * seeds, at_random);
  print_by_hand("water, 0.1 and 0.7 in turn", {control::kNewtonianModel}, 10 * seeds, in_turn);
}

double overshoot(const control::FractionalModel& fluid) {
  std::vector<double> time_s;
  for (double time = 0.01; time < 60; time *= 1.02) time_s.push_back(time);
  const auto response = control::step_response(fluid, fluid.b3 / fluid.kp, time_s).velocity_m_s;
  return *std::ranges::max_element(response) - 1;
}

void print_models(const char* name, const std::vector<control::FractionalModel>& fluids) {
  std::vector<double> errors;
  int swinging = 0, swinging_met = 0;
  for (const control::FractionalModel& fluid : fluids) {
    errors.push_back(control::estimator_model(fluid).fit_error);
    if (overshoot(fluid) <= 0.01) continue;
    ++swinging;
    if (errors.back() <= control::kLargestFitError) ++swinging_met;
  }
  std::ranges::sort(errors);
  const auto to = [&errors](double error) { return std::ranges::upper_bound(errors, error) - errors.begin(); };
  std::printf(
      "%s: %zu fluids; fit error to 0.2 %% in %td, to 0.5 %% in %td, median %.2f %%, worst %.0f %%; "
      "%d overshoot by more than 1 %%, %d of them are met\n",
      name, errors.size(), to(0.002), to(control::kLargestFitError), 100 * errors[errors.size() / 2],
      100 * errors.back(), swinging, swinging_met);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc > 1 && std::strcmp(argv[1], "models") == 0) {
    print_models("drawn", control::fluid_family(1000, 1));
    print_models("ends and middles", control::fluid_family_corners());
    return 0;
  }
  const auto number = [argc, argv](int at, int otherwise) { return argc > at ? std::atoi(argv[at]) : otherwise; };
  if (argc > 1 && std::strcmp(argv[1], "first_seconds") == 0) {
    print_first_seconds(number(2, 80), number(3, 10), static_cast<unsigned>(number(4, 20261129)));
    return 0;
  }
  if (argc > 1 && std::strcmp(argv[1], "by_hand") == 0) {
    print_by_hand(number(2, 80), number(3, 5), static_cast<unsigned>(number(4, 20261129)));
    return 0;
  }
  const int fluids = number(1, 20), seeds = number(2, 10);
  if (fluids < 1 || seeds < 1) return std::fprintf(stderr, "fluid_study: give positive numbers\n"), 2;
  Tally all;
  int drawn = 0;
  std::printf(
      "| b1, b2 of (29) times | alpha | beta | fit error %% | seconds within 2 sd %% | ends within 2 sd | "
      "largest error mm | largest sd mm |\n|---|---|---|---|---|---|---|---|\n");
  for (const control::FractionalModel& fluid : control::fluid_family(4 * fluids + 20, 7)) {
    if (all.fluids == fluids) break;
    ++drawn;
    const control::EstimatorModel model = control::estimator_model(fluid);
    if (!model.is_met) continue;
    const Tally tally = study(fluid, model, seeds);
    const auto& middle = control::kNonNewtonianModel;
    std::printf("| %.2f, %.2f | %.2f | %.2f | %.2f | %.0f | %d of %d | %.1f | %.1f |\n", fluid.b1 / middle.b1,
                fluid.b2 / middle.b2, fluid.alpha, fluid.beta, 100 * model.fit_error,
                100 * tally.seconds_within / seeds, tally.ends_within, seeds, 1e3 * tally.largest_error_m,
                1e3 * tally.largest_sd_m);
    std::fflush(stdout);
    all.add(tally);
  }
  std::printf("\n%d fluids drawn, %d without a model\n", drawn, drawn - all.fluids);
  print(all);
  return 0;
}
