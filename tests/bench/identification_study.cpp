// Prints how well the fit of the acceleration finds five fluids: identification_study [SEEDS [FIRST]]; or how often the
// truth is within the sigmas of six others, each with the script of a scenario: identification_study coverage FILE
// [SEEDS [FIRST]]. The fluid of the file comes first, then five of tests/control/fluid_family.hpp. Or how far the
// margin of a controller that is tuned for the fit is from the true one, in fluids with a dead time that nobody names:
// identification_study margins [SEEDS [FIRST]]. Or how often a fluid that is not linear has a dead time that is not
// there, or one that is: identification_study false_dead_time [SEEDS [FIRST]].
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "control/responses/frequency_response.hpp"
#include "control/tuning/tune.hpp"
#include "server/analysis/control_json.hpp"
#include "server/analysis/tuning/margin_sigmas.hpp"
#include "sim_robot/scenario/scenario.hpp"
#include "tests/control/fluid_family.hpp"
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

constexpr unsigned kFamilySeed = 20261129;
constexpr int kFamilyFluids = 5, kMarginFluids = 4;
constexpr double kPositionSdM = 0.0005;                                    // of a position from outside
constexpr double kCrossover_rad_s = 3, kMargin_deg = 90, kMarginMu = 0.8;  // of what is tuned

std::array<double, control::kParameters> values_of(const control::FractionalModel& m) {
  return {m.kp, m.b1, m.b2, m.alpha, m.beta};
}

double median_of(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

struct Coverage {
  int fits = 0, within_4 = 0, white = 0, clocks = 0;
  std::array<int, control::kParameters> within_2{};
  std::array<std::vector<double>, control::kParameters> sigmas{};
};

// From one start each, as the study of the five fluids.
Coverage coverage_of(const std::string& file, const control::FractionalModel& fluid, int seeds, int first) {
  const control::IdentificationOptions options = sim_robot::one_start_options();
  Coverage found;
  const auto truth = values_of(fluid);
  for (int seed = first; seed < first + seeds; ++seed) {
    const auto recording = sim_robot::record_played(file, static_cast<std::uint64_t>(seed), fluid);
    const control::Fit fit = control::identify(recording, options).best;
    const auto values = values_of(fit.model);
    double worst = 0;
    for (std::size_t i = 0; i < control::kParameters; ++i) {
      const double sigma = fit.one_sigma[i].value_or(0), sigmas = std::abs(values[i] - truth[i]) / sigma;
      found.within_2[i] += sigmas <= 2 ? 1 : 0;
      found.sigmas[i].push_back(sigma);
      worst = std::max(worst, sigmas);
    }
    ++found.fits;
    found.within_4 += worst <= 4 ? 1 : 0;
    found.white += fit.residuals_are_white ? 1 : 0;
    found.clocks += fit.sensor->has_own_clock ? 1 : 0;
  }
  return found;
}

void print_coverage(const control::FractionalModel& fluid, const Coverage& found) {
  std::printf("| %g, %.4g, %.4g, %.5g, %.4g | %d of %d |", fluid.kp, fluid.b1, fluid.b2, fluid.alpha, fluid.beta,
              found.within_4, found.fits);
  int all = 0;
  for (std::size_t i = 0; i < control::kParameters; ++i) {
    all += found.within_2[i];
    std::printf(" %.0f %% (%.2g) |", 100.0 * found.within_2[i] / found.fits, median_of(found.sigmas[i]));
  }
  const int values = found.fits * static_cast<int>(control::kParameters);
  std::printf(" %.1f %% | %d | %d |\n", 100.0 * all / values, found.white, found.clocks);
  std::fflush(stdout);
}

void study_coverage(const std::string& file, int seeds, int first) {
  std::printf("| kp, b1, b2, alpha, beta (%d seeds from %d) | all within 4 sigma | kp within 2 sigma (median sigma) ",
              seeds, first);
  std::printf("| b1 | b2 | alpha | beta | all five | white | own clock |\n|---|---|---|---|---|---|---|---|---|---|\n");
  std::vector<control::FractionalModel> fluids = control::fluid_family(kFamilyFluids, kFamilySeed);
  fluids.insert(fluids.begin(), sim_robot::load_scenario(file).robot.world.plant.model);
  int fits = 0, within_4 = 0, within_2 = 0;
  for (const auto& fluid : fluids) {
    const Coverage found = coverage_of(file, fluid, seeds, first);
    print_coverage(fluid, found);
    fits += found.fits;
    within_4 += found.within_4;
    for (const int within : found.within_2) within_2 += within;
  }
  std::printf("all within 4 sigma: %.1f %% of %d fits; within 2 sigma: %.1f %% of %d values\n", 100.0 * within_4 / fits,
              fits, 100.0 * within_2 / (fits * static_cast<int>(control::kParameters)),
              fits * static_cast<int>(control::kParameters));
}

struct MarginRow {
  int fits = 0, found = 0, tuned = 0, covered = 0, narrow = 0;
  double worst_deg = 0;
  std::vector<double> stated_deg;  // 2 sd
};

// From record to margin, by what a fit's document says: nobody names a dead time.
MarginRow margins_of(const control::FractionalModel& fluid, bool by_position, double dead_time_s, int seeds,
                     int first) {
  control::IdentificationOptions options = sim_robot::one_start_options();
  options.tries_dead_time = true;
  // Less what the dead time takes: the phase that the controller adds is the same.
  const control::TuningSpec spec{kCrossover_rad_s, kMargin_deg - kCrossover_rad_s * dead_time_s * control::kDegPerRad,
                                 kMarginMu, false};
  MarginRow row;
  for (int seed = first; seed < first + seeds; ++seed) {
    const auto number = static_cast<std::uint64_t>(seed);
    const sim_robot::IdentificationTrial trial{fluid, false, sim_robot::study_duty(), dead_time_s};
    const auto recording =
        by_position ? sim_robot::record_position(trial, kPositionSdM, number) : sim_robot::record(trial, number);
    const auto document =
        nlohmann::json::parse(server::analysis::json_of(control::identify(recording, options)).dump());
    const auto model = server::analysis::model_from(document);
    const auto uncertainty = server::analysis::uncertainty_from(document);
    ++row.fits;
    if (!model || !uncertainty) continue;
    row.found += model->dead_time_s > 0 ? 1 : 0;
    const auto tuned = control::tune(*model, spec);
    const auto sigmas = server::analysis::margin_sigmas(*model, tuned, *uncertainty);
    if (!sigmas) continue;
    ++row.tuned;
    control::FractionalModel truth = fluid;
    truth.dead_time_s = dead_time_s;
    const auto in_truth = control::margins({truth, tuned.tuned->controller, false});
    const double off_deg =
        std::abs(in_truth.phase_margin_deg.value_or(-180) - tuned.tuned->achieved.phase_margin_deg.value_or(180));
    row.stated_deg.push_back(2 * sigmas->phase_margin_deg);
    row.covered += off_deg <= row.stated_deg.back() ? 1 : 0;
    row.narrow += row.stated_deg.back() <= 2 ? 1 : 0;
    row.worst_deg = std::max(row.worst_deg, off_deg);
  }
  return row;
}

void study_margins(int seeds, int first) {
  std::printf(
      "| kp, b1, b2, alpha, beta (%d seeds from %d) | fitted | dead time | found | tuned | true margin within 2 sd | "
      "2 sd at most 2 deg | median 2 sd | worst error |\n|---|---|---|---|---|---|---|---|---|\n",
      seeds, first);
  const auto fluids = control::fluid_family(kMarginFluids, kFamilySeed);
  for (const bool by_position : {false, true}) {
    for (const double dead_time_s : {0.0, 0.02, 0.04, 0.06, 0.08}) {
      for (const auto& fluid : fluids) {
        const MarginRow row = margins_of(fluid, by_position, dead_time_s, seeds, first);
        std::printf("| %g, %.4g, %.4g, %.5g, %.4g | %s | %g ms | %d of %d | %d | %d | %d | %.2f deg | %.2f deg |\n",
                    fluid.kp, fluid.b1, fluid.b2, fluid.alpha, fluid.beta, by_position ? "position" : "acceleration",
                    1e3 * dead_time_s, row.found, row.fits, row.tuned, row.covered, row.narrow,
                    row.stated_deg.empty() ? 0 : median_of(row.stated_deg), row.worst_deg);
        std::fflush(stdout);
      }
    }
  }
}

struct DeadTimeRow {
  int fits = 0, found = 0;
  double worst_ms = 0;  // of those that were found
};

// The fluid that thins, by a position and a duty of one amplitude, which does not show that it thins.
DeadTimeRow dead_times_of(double dead_time_s, int seeds, int first) {
  control::IdentificationOptions options = sim_robot::one_start_options();
  options.tries_dead_time = true;
  const sim_robot::IdentificationTrial trial{.fluid = {},
                                             .duty = sim_robot::study_duty(),
                                             .dead_time_s = dead_time_s,
                                             .kind = sim_robot::PlantKind::shear_thinning};
  DeadTimeRow row;
  for (int seed = first; seed < first + seeds; ++seed) {
    const auto recording = sim_robot::record_position(trial, kPositionSdM, static_cast<std::uint64_t>(seed));
    const double found_s = control::identify(recording, options).best.model.dead_time_s;
    ++row.fits;
    if (!(found_s > 0)) continue;
    ++row.found;
    row.worst_ms = std::max(row.worst_ms, 1e3 * std::abs(found_s - dead_time_s));
  }
  return row;
}

void study_false_dead_time(int seeds, int first) {
  std::printf("| dead time of shear_thinning (%d seeds from %d) | found | worst error |\n|---|---|---|\n", seeds,
              first);
  for (const double dead_time_s : {0.0, 0.04, 0.05, 0.06, 0.07, 0.08}) {
    const DeadTimeRow row = dead_times_of(dead_time_s, seeds, first);
    std::printf("| %g ms | %d of %d | %.1f ms |\n", 1e3 * dead_time_s, row.found, row.fits, row.worst_ms);
    std::fflush(stdout);
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::optional<std::string> file;
  if (argc > 2 && std::string_view{argv[1]} == "coverage") file = argv[2], argv += 2, argc -= 2;
  const bool wants_margins = argc > 1 && std::string_view{argv[1]} == "margins";
  const bool wants_dead_times = argc > 1 && std::string_view{argv[1]} == "false_dead_time";
  if (wants_margins || wants_dead_times) ++argv, --argc;
  const int seeds = argc > 1 ? std::atoi(argv[1]) : 40;
  const int first = argc > 2 ? std::atoi(argv[2]) : 1;
  if (seeds < 1) return std::fprintf(stderr, "identification_study: SEEDS '%s' is no positive number\n", argv[1]), 2;
  if (first < 1) return std::fprintf(stderr, "identification_study: FIRST '%s' is no positive number\n", argv[2]), 2;
  if (file) return study_coverage(*file, seeds, first), 0;
  if (wants_margins) return study_margins(seeds, first), 0;
  if (wants_dead_times) return study_false_dead_time(seeds, first), 0;
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
