// In fluids other than its model's the estimator reports how well it knows the position; with the fluid's model
// confirmed it is as sure as ever.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "robot_fw/core/controller.hpp"
#include "sim_robot/world/world.hpp"
#include "tests/control/fluid_family.hpp"
#include "tests/robot_fw/estimator_trial.hpp"

namespace robot_fw {
namespace {

using sim_robot::kTickS;

constexpr int kSeedsPerFluid = 3;
constexpr double kManualS = 30;
constexpr int kDurationS = 42;

// Duties by hand, in turn, each for `ticks`; none: the paper's Figure 7, its loop closed on the estimate.
struct Duties {
  float even = 0, odd = 0;
  int ticks = 100;
};
using Drive = std::optional<Duties>;
constexpr Duties kManualDuties[] = {{0.3F, 0.3F}, {0.8F, 0.8F}, {0.1F, 0.7F}};
constexpr Duties kFastDuty{0.1F, 0.7F, 30};

std::string name_of(const Drive& drive) {
  if (!drive) return "Figure 7";
  return "duty " + std::to_string(drive->even) + ", " + std::to_string(drive->odd) + ", each for " +
         std::to_string(drive->ticks) + " ticks";
}

struct Fluid {
  std::string name;
  control::FractionalModel model;
};

Fluid fluid(std::string name, double b1, double b2, double alpha, double beta, double gain) {
  control::FractionalModel model = control::kNonNewtonianModel;
  model.b1 *= b1;
  model.b2 *= b2;
  model.kp *= gain;
  model.alpha = alpha;
  model.beta = beta;
  return {std::move(name), model};
}

constexpr double kAlpha = control::kNonNewtonianModel.alpha, kBeta = control::kNonNewtonianModel.beta;

std::vector<Fluid> fluids_with_one_difference() {
  return {fluid("b1 x 0.5", 0.5, 1, kAlpha, kBeta, 1),   fluid("b1 x 2", 2, 1, kAlpha, kBeta, 1),
          fluid("b2 x 0.5", 1, 0.5, kAlpha, kBeta, 1),   fluid("b2 x 2", 1, 2, kAlpha, kBeta, 1),
          fluid("alpha 1.4", 1, 1, 1.4, kBeta, 1),       fluid("alpha 1.95", 1, 1, 1.95, kBeta, 1),
          fluid("beta 0.6", 1, 1, kAlpha, 0.6, 1),       fluid("beta 0.98", 1, 1, kAlpha, 0.98, 1),
          fluid("gain x 0.7", 1, 1, kAlpha, kBeta, 0.7), fluid("gain x 1.4", 1, 1, kAlpha, kBeta, 1.4)};
}

// With the DC gain of (29), and everything else another.
std::vector<Fluid> fluids_with_all_differences() {
  std::mt19937 random{7};
  const auto between = [&random](double low, double high) { return std::uniform_real_distribution{low, high}(random); };
  std::vector<Fluid> fluids;
  for (int i = 0; i < 24; ++i) {
    const double b1 = std::exp2(between(-1, 1)), b2 = std::exp2(between(-1, 1));
    const double alpha = between(1.4, 1.95), beta = between(0.6, 0.98);
    fluids.push_back(fluid("fluid " + std::to_string(i), b1, b2, alpha, beta, 1));
  }
  return fluids;
}

struct Second {
  double error_m = 0, sd_m = 0;
  bool is_within() const { return std::abs(error_m) <= 2 * sd_m; }
};

sim_robot::World world_of(const sim_robot::PlantParameters& truth, std::uint64_t seed) {
  sim_robot::WorldConfig config;
  config.plant = truth;
  config.imu = sim_robot::ImuParameters{};
  config.seed = seed;
  return sim_robot::World{config};
}

// Every full second.
std::vector<Second> seconds_of(const sim_robot::PlantParameters& truth, const EstimatorParameters& parameters,
                               const Drive& drive, std::uint64_t seed) {
  sim_robot::World world = world_of(truth, seed);
  Estimator estimator{parameters};
  Controller controller{kPaperController};
  std::vector<Second> seconds;
  float duty = 0;
  for (int tick = 1; tick * kTickS <= kDurationS; ++tick) {
    world.step(static_cast<double>(duty));
    const Inputs inputs = world.read(0);
    estimator.step({inputs.acceleration_counts, inputs.acceleration_is_valid, duty, static_cast<float>(kTickS)});
    const double time_s = tick * kTickS;
    const float target_m = time_s >= 20 ? 0.15F : 0.1F, seen_m = estimator.position_m();
    if (drive)
      duty = time_s < kManualS ? (tick / drive->ticks % 2 == 0 ? drive->even : drive->odd) : 0;
    else
      duty = std::clamp(controller.step(target_m - seen_m, seen_m).asked, -1.0F, 1.0F);
    if (tick % 100 != 0) continue;
    seconds.push_back(
        {static_cast<double>(seen_m) - world.position_m(), static_cast<double>(estimator.position_sd_m())});
  }
  return seconds;
}

std::vector<Second> seconds_of(const std::vector<Fluid>& fluids, const Drive& drive) {
  std::vector<Second> all;
  for (const Fluid& fluid : fluids) {
    for (std::uint64_t seed = 1; seed <= kSeedsPerFluid; ++seed) {
      const auto seconds = seconds_of({.model = fluid.model}, EstimatorParameters{}, drive, seed);
      all.insert(all.end(), seconds.begin(), seconds.end());
    }
  }
  return all;
}

double share_within(const std::vector<Second>& seconds) {
  return static_cast<double>(std::ranges::count_if(seconds, &Second::is_within)) / static_cast<double>(seconds.size());
}

double median_sd_m(std::vector<Second> seconds) {
  const auto middle = seconds.begin() + std::ssize(seconds) / 2;
  std::ranges::nth_element(seconds, middle, {}, &Second::sd_m);
  return middle->sd_m;
}

double rms_error_m(const std::vector<Second>& seconds) {
  double sum = 0;
  for (const Second& second : seconds) sum += second.error_m * second.error_m;
  return std::sqrt(sum / static_cast<double>(seconds.size()));
}

std::vector<Drive> ways_to_drive() {
  std::vector<Drive> ways{std::nullopt};
  ways.insert(ways.end(), std::begin(kManualDuties), std::end(kManualDuties));
  return ways;
}

TEST(EstimatorFluids, ThePositionIsWithinTwoStandardDeviationsWhicheverNumberOfTheFluidDiffers) {
  for (const Fluid& fluid : fluids_with_one_difference()) {
    for (const Drive& drive : ways_to_drive()) {
      EXPECT_GE(share_within(seconds_of({fluid}, drive)), 0.9) << fluid.name << ", " << name_of(drive);
    }
  }
}

TEST(EstimatorFluids, ThePositionIsWithinTwoStandardDeviationsWhenAllNumbersDiffer) {
  auto ways = ways_to_drive();
  ways.emplace_back(kFastDuty);
  for (const Drive& drive : ways) {
    const auto seconds = seconds_of(fluids_with_all_differences(), drive);
    EXPECT_GE(share_within(seconds), 0.9) << name_of(drive);
    // Honest is not vague. In Figure 7's loop the error became smaller, and the sd stayed.
    EXPECT_LE(median_sd_m(seconds), std::max(2.5 * rms_error_m(seconds), 0.0098)) << name_of(drive);
  }
}

TEST(EstimatorFluids, AFastDutyInWaterIsCoveredByTheFluidsParameters) {
  std::vector<Second> seconds;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const auto more = seconds_of({.model = control::kNewtonianModel}, EstimatorParameters{}, kFastDuty, seed);
    seconds.insert(seconds.end(), more.begin(), more.end());
  }
  EXPECT_GE(share_within(seconds), 0.9);  // 84 %, 0.5 m rms, while the model's error was taken for a flow
  EXPECT_LE(rms_error_m(seconds), 0.25);
}

// A duty at random: the error was 27 mm rms, and the sd 74 mm, while it was taken for one in 76 of 420 s.
TEST(EstimatorFluids, AnErrorOfAnAssumedModelIsTakenForNoFlow) {
  std::vector<Second> seconds;
  double flow_s = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    EstimatorTrial trial = figure_7_in({0.1, 0.0034, 0.1765, 1, 1.5, 0.65});
    trial.by_hand = duties_at_random(-1, 1, seed);
    const TrialResult result = run_trial(trial, seed);
    flow_s += result.flow_s;
    for (std::size_t i = 0; i < result.errors_m.size(); ++i) seconds.push_back({result.errors_m[i], result.sds_m[i]});
  }
  EXPECT_LE(flow_s, 10);
  EXPECT_GE(share_within(seconds), 0.9);
  EXPECT_LE(rms_error_m(seconds), 0.015);
  EXPECT_LE(median_sd_m(seconds), 2.5 * rms_error_m(seconds));
}

// In slow fluids and in those that swing, not only in the mean: the second after the first move is the worst one.
TEST(EstimatorFluids, EachSecondOfFigure7IsWithinTwoStandardDeviationsInEachOf80Fluids) {
  const auto fluids = control::fluid_family(80, 20261129);
  for (std::size_t number = 0; number < fluids.size(); ++number) {
    const EstimatorTrial trial = figure_7_in(fluids[number]);
    if (std::ranges::min(shares_within(trial, 10)) >= 0.8 - 1e-9) continue;
    const auto shares = shares_within(trial, 100);
    const auto least = std::ranges::min_element(shares);
    EXPECT_GE(*least, 0.85) << "fluid " << number << ", second " << least - shares.begin() + 1;
  }
}

// A fluid that no linear model describes: its drag goes with the speed to the power of 0.6, and lags. The sd in the
// loop was 8.0 mm, of an error of 4.2 mm rms, before an assumed model could lag; the error is 2 mm now.
TEST(EstimatorFluids, ThePositionIsWithinTwoStandardDeviationsInAFluidThatThinsUnderShear) {
  const sim_robot::PlantParameters thinning = sim_robot::fluid("shear_thinning");
  for (const Drive& drive : {Drive{}, Drive{{0.1F, 0.1F}}, Drive{{0.3F, 0.3F}}, Drive{{0.8F, 0.8F}}}) {
    std::vector<Second> seconds;
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      const auto more = seconds_of(thinning, EstimatorParameters{}, drive, seed);
      seconds.insert(seconds.end(), more.begin(), more.end());
    }
    EXPECT_GE(share_within(seconds), 0.9) << name_of(drive);
    EXPECT_LE(median_sd_m(seconds), std::max(2.5 * rms_error_m(seconds), 0.008)) << name_of(drive);
  }
}

// 4.2 mm and 5.3 mm were the medians of the estimator that knew no other shape than its model's.
TEST(EstimatorFluids, AConfirmedModelIsAsSureAsEver) {
  EstimatorParameters parameters;
  parameters.is_confirmed = true;
  const auto sd_at_end_m = [&parameters](const control::FractionalModel& truth) {
    std::vector<Second> ends;
    for (std::uint64_t seed = 1; seed <= 9; ++seed)
      ends.push_back(seconds_of({.model = truth}, parameters, {}, seed).back());
    EXPECT_GE(share_within(ends), 0.8);
    return median_sd_m(ends);
  };
  EXPECT_LE(sd_at_end_m(control::kNonNewtonianModel), 1.2 * 0.0042);
  parameters.model = kWaterVelocityModel;
  EXPECT_LE(sd_at_end_m(control::kNewtonianModel), 1.2 * 0.0053);
}

TEST(EstimatorFluids, AMismatchEndsWithTheRightModel) {
  EstimatorParameters parameters;
  parameters.is_confirmed = true;
  sim_robot::World world = world_of({.model = control::kNewtonianModel}, 1);
  Estimator estimator{parameters};
  const auto drive_and_rest = [&] {
    bool was_mismatched = false;
    for (int tick = 0; tick < 2000; ++tick) {
      const float duty = tick < 300 ? 0.3F : 0;
      world.step(static_cast<double>(duty));
      const Inputs inputs = world.read(0);
      estimator.step({inputs.acceleration_counts, inputs.acceleration_is_valid, duty, static_cast<float>(kTickS)});
      was_mismatched = was_mismatched || estimator.model_mismatch();
    }
    return was_mismatched;
  };
  EXPECT_TRUE(drive_and_rest());
  EXPECT_TRUE(estimator.model_mismatch());
  ASSERT_TRUE(estimator.is_settled());
  parameters.model = kWaterVelocityModel;
  estimator.set_parameters(parameters);
  EXPECT_FALSE(estimator.model_mismatch());
  EXPECT_FALSE(drive_and_rest());
}

// Every parameter at an end of its range, one short drive: the robot must not lock itself out of better parameters.
TEST(EstimatorFluids, NoParametersKeepTheEstimatorFromSettling) {
  for (const float gain_m_s : {-10.0F, 10.0F}) {
    for (const float time_constant_s : {0.001F, 1000.0F}) {
      EstimatorParameters parameters;
      parameters.model.gain_m_s.fill(gain_m_s);
      parameters.model.time_constant_s.fill(time_constant_s);
      sim_robot::World world = world_of({.model = control::kNonNewtonianModel}, 3);
      Estimator estimator{parameters};
      for (int tick = 0; tick < 4000; ++tick) {
        const float duty = tick < 100 ? 1 : 0;
        world.step(static_cast<double>(duty));
        const Inputs inputs = world.read(0);
        estimator.step({inputs.acceleration_counts, inputs.acceleration_is_valid, duty, static_cast<float>(kTickS)});
      }
      EXPECT_TRUE(estimator.is_settled()) << gain_m_s << ' ' << time_constant_s;
    }
  }
}

}  // namespace
}  // namespace robot_fw
