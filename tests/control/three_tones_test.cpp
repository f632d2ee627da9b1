// The plant at one frequency, from an accelerometer in a closed loop, and the controller that follows from it: ten
// fluids, the default sensor with its noise, bias, quantum and clock.
#include "control/tuning/three_tones.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <utility>

#include "control/discretisation/discretise.hpp"
#include "control/models/modal_plant.hpp"
#include "control/responses/frequency_response.hpp"
#include "control/responses/margins.hpp"
#include "control/tuning/feasible_margins.hpp"
#include "control/tuning/measured_tuning.hpp"
#include "control/tuning/tune.hpp"
#include "tests/control/fluid_family.hpp"

namespace control {
namespace {

using ::testing::HasSubstr;

constexpr double kTickS = 0.01;

// A BNO055 as docs/simulator.md describes it: low pass of 62.5 Hz, noise, quantum, a bias that drifts, samples by a
// clock of its own, and now and then a failed read. The robot's filter takes a bias of its own off.
class Accelerometer {
 public:
  explicit Accelerometer(unsigned seed) : random_{seed} {
    std::uniform_real_distribution<double> any{-1, 1};
    period_s_ = kTickS * (1 + 0.005 * any(random_));
    until_sample_s_ = period_s_ * (any(random_) + 1) / 2;
    drift_m_s3_ = any(random_) < 0 ? -0.000098 : 0.000098;
  }

  // At the next tick, as it is recorded. The acceleration at the tick, and its mean since the last one: a fluid that
  // begins to move as t^1.5 gains much of its velocity at once after a step of the duty.
  float read(double acceleration_m_s2, double mean_m_s2) {
    constexpr double kTurns = 2 * std::numbers::pi * 62.5 * kTickS;
    const double decay = std::exp(-kTurns), late_share = 1 - (1 - decay) / kTurns;
    const double bend_share = 6 * (kTurns - 2 + (kTurns + 2) * decay) / (kTurns * kTurns);
    const double filtered_m_s2 = decay * filtered_m_s2_ + (1 - decay) * before_m_s2_ +
                                 late_share * (acceleration_m_s2 - before_m_s2_) +
                                 bend_share * (mean_m_s2 - (acceleration_m_s2 + before_m_s2_) / 2);
    for (; until_sample_s_ <= kTickS; until_sample_s_ += period_s_) {
      const double sensed = std::lerp(filtered_m_s2_, filtered_m_s2, until_sample_s_ / kTickS) + bias_m_s2_;
      reading_m_s2_ = 0.01 * std::round(100 * (sensed + 0.0116 * normal_(random_)));
    }
    until_sample_s_ -= kTickS;
    bias_m_s2_ += drift_m_s3_ * kTickS;
    before_m_s2_ = acceleration_m_s2;
    filtered_m_s2_ = filtered_m_s2;
    if (++ticks_ % 5 == 0) own_bias_m_s2_ += 1e-5 * normal_(random_);
    return static_cast<float>(reading_m_s2_ - own_bias_m_s2_);
  }

 private:
  std::mt19937 random_;
  std::normal_distribution<double> normal_{0, 1};
  double period_s_, until_sample_s_, drift_m_s3_;
  double bias_m_s2_ = 0.003, own_bias_m_s2_ = 0, before_m_s2_ = 0, filtered_m_s2_ = 0, reading_m_s2_ = 0;
  int ticks_ = 0;
};

struct Recorded {
  std::vector<double> duty, acceleration_m_s2;
  double largest_duty = 0, travel_m = 0;
};

// The paper's controller holds the robot, and three tones move its setpoint; each is to take a duty of `duty`.
Recorded experiment(const FractionalModel& fluid, double crossover_rad_s, double duration_s, double duty,
                    unsigned seed) {
  ModalPlant plant{fluid, kTickS};
  Accelerometer sensor{seed};
  SectionFilter controller{discretise(kPaperController, {}).sections};
  const PlantOnAxis on_axis{fluid, false};
  std::array<double, 3> tones_m{};
  for (std::size_t i = 0; i < 3; ++i) {
    const double omega = three_tones_rad_s(crossover_rad_s)[i];
    const Complex loop = on_axis.at(std::log(omega)).value * controller_transfer(kPaperController, {0, omega});
    tones_m[i] = duty * std::abs(on_axis.at(std::log(omega)).value * (1.0 + loop) / loop);
  }
  Recorded recorded;
  double farthest_m = 0, velocity_m_s = 0;
  for (double t_s = 0; t_s < duration_s; t_s += kTickS) {
    double setpoint_m = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      setpoint_m += tones_m[i] * std::sin(three_tones_rad_s(crossover_rad_s)[i] * t_s + 2.0 * static_cast<double>(i));
    }
    const double mean_m_s2 = (plant.velocity_m_s() - std::exchange(velocity_m_s, plant.velocity_m_s())) / kTickS;
    recorded.acceleration_m_s2.push_back(static_cast<double>(sensor.read(plant.acceleration_m_s2(), mean_m_s2)));
    recorded.duty.push_back(std::clamp(controller.step(setpoint_m - plant.position_m()), -1.0, 1.0));
    plant.step(recorded.duty.back());
    farthest_m = std::max(farthest_m, std::abs(plant.position_m()));
    recorded.largest_duty = std::max(recorded.largest_duty, std::abs(recorded.duty.back()));
  }
  recorded.travel_m = 2 * farthest_m;
  return recorded;
}

MeasuredPlant measured(const Recorded& recorded, double crossover_rad_s) {
  return measure_three_tones({recorded.duty, recorded.acceleration_m_s2, kTickS, 5, kReadingLagS}, crossover_rad_s);
}

struct Truth {
  double modulus, phase_rad, phase_fall;
};
Truth truth_of(const FractionalModel& fluid, double omega_rad_s) {
  const AxisPoint at = PlantOnAxis{fluid, false}.at(std::log(omega_rad_s));
  return {std::abs(at.value), at.phase_rad, -at.log_slope.imag()};
}

TEST(ThreeTones, MeasureTenFluidsWithTheDefaultSensor) {
  constexpr double kCrossover = 4;
  int modulus = 0, phase = 0, slope = 0, all = 0, within_3_sigma = 0;
  unsigned seed = 1;
  for (const FractionalModel& fluid : fluid_family(10, 7)) {
    const Recorded recorded = experiment(fluid, kCrossover, 70, 0.25, seed++);
    EXPECT_LT(recorded.largest_duty, 1) << "the tones must not be clipped";
    EXPECT_LT(recorded.travel_m, 0.25);
    const MeasuredPlant plant = measured(recorded, kCrossover);
    ASSERT_EQ(plant.refusal, "");
    const Truth truth = truth_of(fluid, kCrossover);
    const MeasuredPoint& at = plant.at_crossover();
    const bool is_modulus = std::abs(at.modulus / truth.modulus - 1) < 0.02;
    const bool is_phase = std::abs(at.phase_rad - truth.phase_rad) * kDegPerRad < 2;
    const bool is_slope = std::abs(plant.phase_fall / truth.phase_fall - 1) < 0.1;
    modulus += is_modulus;
    phase += is_phase;
    slope += is_slope;
    all += is_modulus && is_phase && is_slope;
    within_3_sigma += std::abs(std::log(at.modulus / truth.modulus)) < 3 * at.sigma + 0.005;
    RecordProperty("fluid_" + std::to_string(seed - 1),
                   std::to_string(100 * (at.modulus / truth.modulus - 1)) + " %, " +
                       std::to_string((at.phase_rad - truth.phase_rad) * kDegPerRad) + " deg, " +
                       std::to_string(100 * (plant.phase_fall / truth.phase_fall - 1)) + " % +- " +
                       std::to_string(100 * plant.phase_fall_sigma / truth.phase_fall));
  }
  EXPECT_GE(modulus, 8);
  EXPECT_GE(phase, 8);
  EXPECT_GE(slope, 8);
  EXPECT_GE(all, 8);
  EXPECT_GE(within_3_sigma, 9);
}

// The margins are those of the true fluid under the controller that was tuned without knowing it.
TEST(ThreeTones, TheControllerTunedFromThemHasTheMarginAskedFor) {
  constexpr double kCrossover = 4;
  int close = 0, feasible = 0;
  unsigned seed = 21;
  for (const FractionalModel& fluid : fluid_family(10, 7)) {
    ++seed;
    const auto range = feasible_phase_margins(fluid, kCrossover);
    if (!range || range->high_deg - range->low_deg < 10) continue;
    ++feasible;
    const Recorded recorded = experiment(fluid, kCrossover, 70, 0.25, seed);
    TuningSpec spec{kCrossover, (range->low_deg + range->high_deg) / 2, {}, false};
    const MeasuredTuning tuned = tune_measured(measured(recorded, kCrossover), spec);
    ASSERT_TRUE(tuned.controller) << tuned.reason;
    const Margins achieved = margins({fluid, *tuned.controller, false});
    EXPECT_NEAR(*achieved.gain_crossover_rad_s, kCrossover, 0.05 * kCrossover);
    close += std::abs(*achieved.phase_margin_deg - spec.phase_margin_deg) < 5 ? 1 : 0;
  }
  EXPECT_GE(feasible, 5);
  EXPECT_GE(close, feasible - 1);
}

TEST(ThreeTones, AreExactWithoutNoise) {
  constexpr double kCrossover = 3;
  const FractionalModel fluid = kNonNewtonianModel;
  ModalPlant plant{fluid, kTickS};
  std::vector<double> duty, acceleration_m_s2;  // the mean over the tick before each, which lags by half a tick
  double velocity_m_s = 0;
  for (int k = 0; k < 8000; ++k) {
    double sum = 0;
    for (const double omega : three_tones_rad_s(kCrossover)) sum += 0.25 * std::sin(omega * k * kTickS);
    acceleration_m_s2.push_back((plant.velocity_m_s() - std::exchange(velocity_m_s, plant.velocity_m_s())) / kTickS);
    duty.push_back(sum);
    plant.step(sum);
  }
  const MeasuredPlant found = measure_three_tones({duty, acceleration_m_s2, kTickS, 10, kTickS / 2}, kCrossover);
  const Truth truth = truth_of(fluid, kCrossover);
  EXPECT_NEAR(found.at_crossover().modulus / truth.modulus, 1, 0.001);
  EXPECT_NEAR(found.at_crossover().phase_rad, truth.phase_rad, 0.01);
  EXPECT_NEAR(found.phase_fall / truth.phase_fall, 1, 0.02);
  EXPECT_NEAR(found.used_s, 3 * tone_window_s(kCrossover), kTickS);
}

TEST(ThreeTones, ALagThatIsNotTakenOutIsAPhase) {
  const Recorded recorded = experiment(kNonNewtonianModel, 4, 60, 0.25, 3);
  const ToneRecord with{recorded.duty, recorded.acceleration_m_s2, kTickS, 5, kReadingLagS};
  ToneRecord without = with;
  without.sensor_lag_s = 0;
  const double difference_rad =
      measure_three_tones(with, 4).at_crossover().phase_rad - measure_three_tones(without, 4).at_crossover().phase_rad;
  EXPECT_NEAR(difference_rad, 4 * kReadingLagS, 1e-9);
}

TEST(ThreeTones, RefuseWhatTheRecordDoesNotShow) {
  const Recorded quiet = experiment(kNonNewtonianModel, 1, 70, 0.002, 4);
  EXPECT_THAT(measured(quiet, 1).refusal, HasSubstr("are not explained; use a larger tone or a longer record"));
  const Recorded brief = experiment(kNonNewtonianModel, 4, 15, 0.25, 4);
  EXPECT_THAT(measured(brief, 4).refusal, HasSubstr("a whole period of all three at 4 rad/s takes 15.71 s"));
  const std::vector<double> rest(3000, 0.0);
  EXPECT_THAT(measure_three_tones({rest, rest}, 4).refusal, HasSubstr("the duty has no tone at 2.8 rad/s"));
  const std::vector<double> shorter(2999, 0.0);
  EXPECT_THROW(measure_three_tones({rest, shorter}, 4), std::invalid_argument);
  EXPECT_THROW(measure_three_tones({rest, rest}, 0), std::invalid_argument);
  EXPECT_THROW(measure_three_tones({rest, rest}, 200), std::invalid_argument);
}

constexpr double kCrossover = 3;

MeasuredPlant exactly_measured(const FractionalModel& model) {
  MeasuredPlant plant;
  for (std::size_t i = 0; i < 3; ++i) {
    MeasuredPoint& point = plant.points[i];
    point.omega_rad_s = three_tones_rad_s(kCrossover)[i];
    const Truth truth = truth_of(model, point.omega_rad_s);
    point.modulus = truth.modulus;
    point.phase_rad = truth.phase_rad;
    point.sigma = 0.01;
    if (i == 1) plant.phase_fall = truth.phase_fall;
  }
  return plant;
}

// The same equations as tune's: with exact numbers the same controller.
TEST(MeasuredTuning, IsThatOfTheModelForExactNumbers) {
  MeasuredPlant plant = exactly_measured(kNonNewtonianModel);
  plant.phase_fall_sigma = 0.02;
  const TuningSpec spec{kCrossover, 90, {}, false};
  const MeasuredTuning found = tune_measured(plant, spec);
  ASSERT_TRUE(found.controller) << found.reason;
  const FopdController of_model = tune(kNonNewtonianModel, spec).tuned->controller;
  EXPECT_NEAR(found.controller->kp / of_model.kp, 1, 1e-9);
  EXPECT_NEAR(found.controller->kd / of_model.kd, 1, 1e-9);
  EXPECT_NEAR(found.controller->mu / of_model.mu, 1, 1e-9);
  EXPECT_NEAR(found.phase_margin_sigma_deg, std::hypot(0.573, 0.3), 0.001) << "of the noise, and of the method";
  for (MeasuredPoint& point : plant.points) point.sigma = 0;
  plant.phase_fall_sigma = 0;
  const MeasuredTuning without_noise = tune_measured(plant, spec);
  EXPECT_NEAR(without_noise.phase_margin_sigma_deg, 0.3, 1e-9);
  EXPECT_NEAR(found.crossover_sigma_rad_s / without_noise.crossover_sigma_rad_s, std::hypot(0.01, 0.014) / 0.014, 1e-9);
  EXPECT_NEAR(without_noise.phase_slope_sigma_deg_per_rad_s, 0.043 * plant.phase_fall * 180 / M_PI / kCrossover, 1e-9);

  const MeasuredTuning infeasible = tune_measured(plant, {kCrossover, 60, {}, false});
  EXPECT_FALSE(infeasible.controller);
  EXPECT_EQ(infeasible.reason, tune(kNonNewtonianModel, {kCrossover, 60, {}, false}).reason);
  const TunedController nearest_by_model = tune(kNonNewtonianModel, {kCrossover, 60, {}, false}).nearest.at(0);
  ASSERT_EQ(infeasible.nearest.size(), 1U);
  EXPECT_EQ(infeasible.nearest[0].name, nearest_by_model.name);
  EXPECT_NEAR(infeasible.nearest[0].spec.phase_margin_deg, nearest_by_model.spec.phase_margin_deg, 1e-6);
  EXPECT_NEAR(infeasible.nearest[0].controller.kp / nearest_by_model.controller.kp, 1, 1e-6);
  EXPECT_THROW(tune_measured(plant, {4, 90, {}, false}), std::invalid_argument);

  MeasuredPlant resonant = plant;
  resonant.points[2].modulus = 3 * plant.points[1].modulus;
  EXPECT_THAT(tune_measured(resonant, spec).reason, HasSubstr("the loop would cross over elsewhere"));
  EXPECT_TRUE(tune_measured(resonant, spec).nearest.empty())
      << "its gain is above 1 at the upper tone with every margin";
  MeasuredPlant unseen;
  unseen.refusal = "too short";
  EXPECT_EQ(tune_measured(unseen, spec).reason, "too short");
  EXPECT_TRUE(tune_measured(unseen, spec).nearest.empty());
}

// Every specification, iso-damped or with a fixed mu: what is refused comes with what can be reached, and that is
// granted.
TEST(MeasuredTuning, ARefusalNamesWhatCanBeReached) {
  const MeasuredPlant plant = exactly_measured(kNonNewtonianModel);
  int refused = 0;
  for (const std::optional<double> mu : {std::optional<double>{}, {0.3}, {0.9}, {1.2}}) {
    for (double margin_deg = 5; margin_deg < 180; margin_deg += 12.5) {
      SCOPED_TRACE(testing::Message() << margin_deg << " degrees, mu " << mu.value_or(0));
      const MeasuredTuning found = tune_measured(plant, {kCrossover, margin_deg, mu, false});
      if (found.controller) {
        EXPECT_TRUE(found.nearest.empty() && found.relaxed.empty());
        continue;
      }
      ++refused;
      EXPECT_FALSE(found.nearest.empty()) << found.reason;
      for (const auto* offers : {&found.nearest, &found.relaxed}) {
        for (const MeasuredOffer& offer : *offers) {
          const MeasuredTuning again = tune_measured(plant, offer.spec);
          ASSERT_TRUE(again.controller) << offer.name << ": " << again.reason;
          EXPECT_EQ(again.controller->kp, offer.controller.kp);
        }
      }
    }
  }
  EXPECT_GT(refused, 10);
}

}  // namespace
}  // namespace control
