// Runs trials in virtual time and gathers what many seeds give.
#include "tests/robot_fw/estimator_trial.hpp"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <numbers>
#include <random>

#include "robot_fw/core/controller.hpp"
#include "sim_robot/world/world.hpp"

namespace robot_fw {
namespace {

using sim_robot::kTickS;

constexpr double kSecondPartS = 20;

control::FractionalModel scaled(control::FractionalModel model, double gain) {
  model.kp *= gain;
  return model;
}

// A tube without end, so that the flow is the same wherever the robot goes.
sim_robot::VesselParameters endless_tube(double mean_flow_m_s, double pump_on_at_s) {
  sim_robot::VesselParameters tube;
  tube.large_length_m = 1e5;
  tube.junction_m = 5e4;
  const double area_m2 = std::numbers::pi / 4 * tube.large_diameter_m * tube.large_diameter_m;
  tube.pump = {.mean_flow_m3_s = mean_flow_m_s * area_m2, .starts_at_s = pump_on_at_s, .compliance_s = 0};
  return tube;
}

sim_robot::World world_of(const EstimatorTrial& trial, std::uint64_t seed) {
  sim_robot::WorldConfig config;
  config.plant.model = scaled(trial.truth, trial.plant_gain);
  config.motor.dead_zone_duty = trial.dead_zone_duty;
  if (trial.mean_flow_m_s != 0) config.vessel = endless_tube(trial.mean_flow_m_s, trial.pump_on_at_s);
  config.imu = trial.imu;
  config.seed = seed;
  return sim_robot::World{config};
}

double percentile_95(std::vector<double> values) {
  std::ranges::sort(values);
  return values[static_cast<std::size_t>(std::ceil(0.95 * static_cast<double>(values.size()))) - 1];
}

}  // namespace

TrialResult run_trial(const EstimatorTrial& trial, std::uint64_t seed) {
  sim_robot::World world = world_of(trial, seed);
  Estimator estimator{trial.estimator};
  Controller controller{kPaperController};
  TrialResult result;
  float duty = 0;
  const auto ticks = std::lround(trial.duration_s / kTickS);
  for (long tick = 1; tick <= ticks; ++tick) {
    world.step(static_cast<double>(duty));
    const Inputs inputs = world.read(0);
    estimator.step({inputs.acceleration_counts, inputs.acceleration_is_valid, duty, static_cast<float>(kTickS)});

    const double time_s = static_cast<double>(tick) * kTickS;
    const bool second_part = time_s >= kSecondPartS;
    const double target_m =
        second_part ? trial.second_setpoint_m - trial.disturbance_m : trial.setpoint_m;  // of the true position
    const double seen_m = trial.closed_loop ? static_cast<double>(estimator.position_m()) : world.position_m();
    const float wanted = controller.step(static_cast<float>(target_m - seen_m), static_cast<float>(seen_m)).asked;
    duty = trial.by_hand ? trial.by_hand(tick) : std::clamp(wanted, trial.duty.min, trial.duty.max);

    result.estimate_error_m = static_cast<double>(estimator.position_m()) - world.position_m();
    result.target_error_m = world.position_m() - target_m;
    result.position_sd_m = static_cast<double>(estimator.position_sd_m());
    if (result.mismatch_s < 0 && estimator.model_mismatch()) result.mismatch_s = time_s;
    if (estimator.flow_m_s() > 0) result.flow_s += kTickS;
    if (tick % 100 != 0) continue;
    result.errors_m.push_back(result.estimate_error_m);
    result.sds_m.push_back(result.position_sd_m);
    const bool within = std::abs(result.estimate_error_m) <= 2 * result.position_sd_m;
    result.share_within += (within ? 1 : 0) / std::floor(trial.duration_s);
  }
  return result;
}

DutyByHand duties_at_random(float least, float most, std::uint64_t seed) {
  constexpr long kTicks = 3000;
  std::mt19937_64 random{seed};
  std::vector<float> duties;
  while (std::ssize(duties) < kTicks) {
    const auto ticks = std::uniform_int_distribution<std::size_t>{3, 100}(random);
    duties.insert(duties.end(), ticks, std::uniform_real_distribution{least, most}(random));
  }
  return [duties](long tick) { return tick <= kTicks ? duties[static_cast<std::size_t>(tick - 1)] : 0; };
}

EstimatorTrial figure_7_in(const control::FractionalModel& fluid) {
  EstimatorTrial trial;
  trial.truth = fluid;
  trial.estimator = {};
  trial.closed_loop = true;
  trial.disturbance_m = -0.05;
  return trial;
}

std::vector<double> shares_within(const EstimatorTrial& trial, int seeds) {
  std::vector<double> shares;
  for (int seed = 1; seed <= seeds; ++seed) {
    const TrialResult result = run_trial(trial, static_cast<std::uint64_t>(seed));
    shares.resize(result.errors_m.size());
    for (std::size_t second = 0; second < shares.size(); ++second) {
      const bool within = std::abs(result.errors_m[second]) <= 2 * result.sds_m[second];
      shares[second] += (within ? 1.0 : 0.0) / seeds;
    }
  }
  return shares;
}

StudyRow run_study(const EstimatorTrial& trial, int seeds) {
  StudyRow row;
  std::vector<double> errors_m, targets_m, sds_m;
  for (int seed = 1; seed <= seeds; ++seed) {
    const TrialResult result = run_trial(trial, static_cast<std::uint64_t>(seed));
    errors_m.push_back(std::abs(result.estimate_error_m));
    targets_m.push_back(std::abs(result.target_error_m));
    sds_m.push_back(result.position_sd_m);
    row.error_rms_m += result.estimate_error_m * result.estimate_error_m / seeds;
    row.share_within += (errors_m.back() <= 2 * result.position_sd_m ? 1.0 : 0.0) / seeds;
    row.seconds_within += result.share_within / seeds;
    if (result.mismatch_s < 0) continue;
    row.mismatch_first_s = row.mismatches == 0 ? result.mismatch_s : std::min(row.mismatch_first_s, result.mismatch_s);
    row.mismatch_last_s = std::max(row.mismatch_last_s, result.mismatch_s);
    ++row.mismatches;
  }
  row.error_rms_m = std::sqrt(row.error_rms_m);
  row.error_95_m = percentile_95(errors_m);
  row.target_95_m = percentile_95(targets_m);
  std::ranges::nth_element(sds_m, sds_m.begin() + seeds / 2);
  row.sd_m = sds_m[static_cast<std::size_t>(seeds / 2)];
  return row;
}

std::vector<NamedTrial> study_trials() {
  using Change = void (*)(EstimatorTrial&);
  std::vector<NamedTrial> rows;
  const auto add = [&rows](const char* name, Expectation expected, std::initializer_list<Change> changes) {
    EstimatorTrial trial;
    for (const Change change : changes) change(trial);
    rows.push_back({name, trial, expected});
  };
  constexpr Change kWeaker = [](EstimatorTrial& t) { t.plant_gain = 0.8; };
  constexpr Change kStronger = [](EstimatorTrial& t) { t.plant_gain = 1.2; };
  constexpr Change kSecond = [](EstimatorTrial& t) { t.second_setpoint_m = 0.2, t.duration_s = 62; };
  constexpr Change kFigure7 = [](EstimatorTrial& t) { t.closed_loop = true, t.disturbance_m = -0.05; };
  constexpr Change kForward = [](EstimatorTrial& t) { t.duty.min = 0; };
  constexpr Change kInWater = [](EstimatorTrial& t) { t.truth = control::kNewtonianModel; };
  constexpr Change kKnowsWater = [](EstimatorTrial& t) { t.estimator.model = kWaterVelocityModel; };
  constexpr Change kDeadZone = [](EstimatorTrial& t) { t.dead_zone_duty = 0.03, t.imu.missed_read_probability = 0.02; };
  constexpr Change kKnowsDeadZone = [](EstimatorTrial& t) { t.estimator.dead_zone_duty = 0.03F; };
  constexpr Change kHolding = [](EstimatorTrial& t) { t.closed_loop = true; };
  constexpr Change kFlow40 = [](EstimatorTrial& t) { t.mean_flow_m_s = 0.04; };
  constexpr Change kFlow100 = [](EstimatorTrial& t) { t.mean_flow_m_s = 0.1; };
  constexpr Change kLater = [](EstimatorTrial& t) { t.pump_on_at_s = 20; };
  constexpr Expectation kHeld, kNoTarget{false, Mismatch::never}, kWrong{false, Mismatch::always},
      kAllowed{false, Mismatch::allowed}, kHeldAllowed{true, Mismatch::allowed};

  add("0.1 m move", kHeld, {});
  add("plant gain 0.8", kHeld, {kWeaker});
  add("plant gain 1.2", kHeld, {kStronger});
  add("second move", kHeld, {kSecond});
  add("second move, gain 0.8", kHeld, {kSecond, kWeaker});
  add("second move, gain 1.2", kHeld, {kSecond, kStronger});
  add("loop on the estimate, duty [-1, 1]", kHeld, {kFigure7});
  add("the same, gain 0.8", kHeld, {kFigure7, kWeaker});
  add("the same, gain 1.2", kHeld, {kFigure7, kStronger});
  add("loop on the estimate, duty [0, 1]", kNoTarget, {kFigure7, kForward});
  add("water, water's parameters", kHeld, {kInWater, kKnowsWater});
  add("the same, loop on the estimate", kHeld, {kInWater, kKnowsWater, kFigure7});
  add("water, the fluid's parameters", kWrong, {kInWater});
  add("the same, loop on the estimate", kWrong, {kInWater, kFigure7});
  add("fluid, water's parameters", kWrong, {kKnowsWater});
  add("water, dead zone 0.03, 2 % misreads", kAllowed, {kInWater, kKnowsWater, kDeadZone});
  add("the same, loop on the estimate", kHeldAllowed, {kInWater, kKnowsWater, kDeadZone, kFigure7});
  add("the same, dead_zone_duty set", kHeld, {kInWater, kKnowsWater, kDeadZone, kFigure7, kKnowsDeadZone});
  add("pump on, mean flow 0", kHeld, {kHolding});
  add("pump on, mean flow 0.04 m/s", kAllowed, {kHolding, kFlow40});
  add("pump on, mean flow 0.1 m/s", kAllowed, {kHolding, kFlow100});
  add("pump on from 20 s, mean flow 0.1 m/s", kAllowed, {kHolding, kFlow100, kLater});
  return rows;
}

}  // namespace robot_fw
