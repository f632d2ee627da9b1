// A dead time of the plant is in everything that is computed of it: margins, tuning, responses, predictions, plans.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <stdexcept>

#include "control/identification/identify.hpp"
#include "control/models/delay_line.hpp"
#include "control/models/grunwald_letnikov.hpp"
#include "control/models/modal_plant.hpp"
#include "control/responses/closed_loop.hpp"
#include "control/responses/continuous_loop.hpp"
#include "control/responses/frequency_response.hpp"
#include "control/responses/time_response.hpp"
#include "control/tuning/robustness.hpp"
#include "control/tuning/tune.hpp"

namespace control {
namespace {

using std::numbers::pi;
using testing::ElementsAre;
using testing::HasSubstr;

FractionalModel delayed(FractionalModel model, double dead_time_s) {
  model.dead_time_s = dead_time_s;
  return model;
}

// kp e^{-sT}/(s + 1), a plain gain: its crossovers are known in closed form.
OpenLoop first_order_loop(double gain, double dead_time_s) {
  return {delayed({1, 0, 1, 1, 2, 1}, dead_time_s), {gain, 0, 1}, true};
}

// Where its phase is -(2n + 1)π.
double phase_crossover(double dead_time_s, int n) {
  double low = 0, high = 1e6;
  for (int i = 0; i < 200; ++i) {
    const double middle = (low + high) / 2;
    (std::atan(middle) + middle * dead_time_s < (2 * n + 1) * pi ? low : high) = middle;
  }
  return low;
}

// By how much 1 + L turns from the lowest frequency to the highest, in small steps: 0 where the closed loop is stable,
// or a quarter forwards with the integrator of a position loop, whose L begins at -j∞.
double turns_of_one_plus(const OpenLoop& loop) {
  double turned = 0, omega = 1e-4;
  Complex l = open_loop_response(loop, omega), before = 1.0 + l;
  while (omega < 50 || (std::abs(l) > 0.05 && omega < 1e4)) {
    omega += std::min(omega * 0.02, 0.05 / loop.plant.dead_time_s);
    l = open_loop_response(loop, omega);
    turned += std::arg((1.0 + l) / before);
    before = 1.0 + l;
  }
  return turned / (2 * pi);
}

bool is_stable_by_turns(const OpenLoop& loop) {
  return std::abs(turns_of_one_plus(loop) - (loop.is_velocity_loop ? 0 : 0.25)) < 0.1;
}

TEST(DeadTime, SeventyMillisecondsTakeThePhaseMarginFrom48To13Degrees) {
  const FractionalModel prompt{0.1504, 0.00898, 0.11031, 1, 1.7263, 0.8682};
  const Margins without = margins({prompt, kPaperController});
  const Margins with = margins({delayed(prompt, 0.07), kPaperController});
  EXPECT_NEAR(*without.phase_margin_deg, 48.2, 0.05);
  EXPECT_NEAR(*with.phase_margin_deg, 12.8, 0.05);
  EXPECT_EQ(*with.gain_crossover_rad_s, *without.gain_crossover_rad_s);
  EXPECT_NEAR(*with.phase_margin_deg, *without.phase_margin_deg - *with.gain_crossover_rad_s * 0.07 * kDegPerRad, 1e-9);
  EXPECT_NEAR(*with.phase_slope_deg_per_rad_s, *without.phase_slope_deg_per_rad_s - 0.07 * kDegPerRad, 1e-9);
  EXPECT_GT(with.ms, 2 * without.ms);
}

TEST(DeadTime, MarginsOfAFirstOrderPlantAreThoseOfItsClosedForm) {
  for (const double dead_time_s : {0.05, 0.7, 20.0}) {
    const double gain = 1.3, crossover = std::sqrt(gain * gain - 1);
    const Margins found = margins(first_order_loop(gain, dead_time_s));
    SCOPED_TRACE(dead_time_s);
    EXPECT_NEAR(*found.gain_crossover_rad_s, crossover, 1e-12);
    const double margin_rad = pi - std::atan(crossover) - crossover * dead_time_s;
    EXPECT_NEAR(*found.phase_margin_deg, margin_rad * kDegPerRad, 1e-9);
    for (std::size_t n = 0; n < found.phase_crossovers_rad_s.size(); ++n) {
      EXPECT_NEAR(found.phase_crossovers_rad_s[n] / phase_crossover(dead_time_s, static_cast<int>(n)), 1, 1e-10);
    }
    const std::size_t listed = found.phase_crossovers_rad_s.size();  // as many as have |L| above 0.1, or one
    ASSERT_GE(listed, 1u);
    EXPECT_LT(gain / std::hypot(1, phase_crossover(dead_time_s, static_cast<int>(listed))), 0.1);
    if (listed > 1) EXPECT_GT(gain / std::hypot(1, found.phase_crossovers_rad_s.back()), 0.1);
    const double above = std::hypot(1, phase_crossover(dead_time_s, 0)) / gain;
    EXPECT_EQ(found.is_closed_loop_stable, above > 1);
    EXPECT_NEAR(*found.gain_margin_db, 20 * std::log10(above), above > 1 ? 1e-9 : 20);
  }
}

TEST(DeadTime, TheClosedLoopIsStableExactlyUpToTheUltimateGain) {
  for (const double dead_time_s : {0.01, 0.3, 5.0, 300.0}) {
    const double ultimate = std::hypot(1, phase_crossover(dead_time_s, 0));
    EXPECT_TRUE(margins(first_order_loop(ultimate * 0.999, dead_time_s)).is_closed_loop_stable) << dead_time_s;
    EXPECT_FALSE(margins(first_order_loop(ultimate * 1.001, dead_time_s)).is_closed_loop_stable) << dead_time_s;
    EXPECT_FALSE(margins(first_order_loop(ultimate * 50, dead_time_s)).is_closed_loop_stable) << dead_time_s;
  }
}

// A gain that does not fall turns about -1 for ever, although without the dead time the loop is stable.
TEST(DeadTime, ALoopWhoseGainStaysAboveOneIsUnstable) {
  OpenLoop loop{{1, 0, 1, 1, 2, 1}, {1, 2, 1}, true};  // (1 + 2 s)/(1 + s)
  EXPECT_TRUE(margins(loop).is_closed_loop_stable);
  loop.plant.dead_time_s = 1e-3;
  EXPECT_FALSE(margins(loop).is_closed_loop_stable);
  loop.controller.kd = 0.5;  // ends at half, always below 1
  loop.controller.kp = 0.9;
  const Margins below = margins(loop);
  EXPECT_TRUE(below.is_closed_loop_stable);
  EXPECT_GE(below.ms, 1 / (1 - 0.45) * (1 - 1e-12));  // the worst of the turns
}

class RandomDelayedLoops {
 public:
  OpenLoop next() {
    OpenLoop loop;
    const double beta = between(0.3, 1), alpha = between(beta + 0.2, 2);
    loop.plant = {1, std::exp(between(-5, 1)), std::exp(between(-3, 1)), 1, alpha, beta, std::exp(between(-5, 1))};
    loop.is_velocity_loop = between(0, 1) < 0.3;
    const double mu = between(0.1, std::min(0.9, (loop.plant.b1 > 0 ? alpha : beta) - 0.1));
    loop.controller = {std::exp(between(-2, 4)), std::exp(between(-4, 0)), mu};
    return loop;
  }

  double between(double low, double high) { return std::uniform_real_distribution{low, high}(generator_); }

 private:
  std::mt19937 generator_{20210601};
};

TEST(DeadTime, StabilityIsWhatTheTurnsOfOnePlusLSay) {
  RandomDelayedLoops loops;
  int stable = 0, unstable = 0;
  for (int i = 0; i < 60; ++i) {
    const OpenLoop loop = loops.next();
    const Margins found = margins(loop);
    EXPECT_EQ(found.is_closed_loop_stable, is_stable_by_turns(loop)) << i;
    found.is_closed_loop_stable ? ++stable : ++unstable;
    if (!found.is_closed_loop_stable) continue;
    EXPECT_GT(*found.gain_margin_db * *found.gain_margin_db, 0);
    for (const double omega : found.gain_crossovers_rad_s) {
      EXPECT_NEAR(std::abs(open_loop_response(loop, omega)), 1, 1e-11);
    }
  }
  EXPECT_GT(stable, 10);
  EXPECT_GT(unstable, 10);
}

TEST(DeadTime, PeaksAndCrossoversAreThoseOfADenseScan) {
  RandomDelayedLoops loops;
  for (int i = 0; i < 30; ++i) {
    const OpenLoop loop = loops.next();
    const Margins found = margins(loop);
    double ms = 0, mt = 0;
    std::size_t passages = 0;
    Complex before = open_loop_response(loop, 1e-3);
    for (double omega = 1e-3; omega < 300; omega += std::min(omega * 2e-3, 0.01 / loop.plant.dead_time_s)) {
      const Complex l = open_loop_response(loop, omega);
      ms = std::max(ms, 1 / std::abs(1.0 + l));
      mt = std::max(mt, std::abs(l / (1.0 + l)));
      passages += l.imag() * before.imag() < 0 && l.real() < -0.1;
      before = l;
    }
    SCOPED_TRACE(i);
    EXPECT_GE(found.ms, ms * (1 - 1e-9));
    if (ms < 5) EXPECT_LT(found.ms, ms * 1.02);
    EXPECT_GE(found.mt, mt * (1 - 1e-9));
    if (mt < 5) EXPECT_LT(found.mt, std::max(mt, 1.0) * 1.02);
    const auto listed = std::ranges::count_if(found.phase_crossovers_rad_s, [](double omega) { return omega < 300; });
    EXPECT_NEAR(static_cast<double>(listed), static_cast<double>(passages), 1);  // at |L| = 0.1 either may be
  }
}

// Where the first turn of L lies below 1 and a resonance lifts it above 1 on the second, the margin is of that turn.
TEST(DeadTime, AMarginAfterAHarmlessTurnIsOfTheNearestOddMultiple) {
  const FractionalModel resonant{0.05, 0.01, 0.002, 1, 2, 1, 0.6};
  bool is_found = false;
  for (double dead_time_s = 0.5; dead_time_s < 1.2; dead_time_s += 0.05) {
    const OpenLoop loop{delayed(resonant, dead_time_s), {10, 0, 1}, true};
    const Margins found = margins(loop);
    if (found.gain_crossovers_rad_s.size() != 2) continue;
    EXPECT_EQ(found.is_closed_loop_stable, is_stable_by_turns(loop)) << dead_time_s;
    if (!found.is_closed_loop_stable) continue;
    is_found = true;
    EXPECT_LT(open_loop_phase_rad(loop, *found.gain_crossover_rad_s), -pi);
    EXPECT_LE(std::abs(*found.phase_margin_deg), 180);
  }
  EXPECT_TRUE(is_found);
}

TEST(DeadTime, WhatTuneCallsFeasibleIsSoundWithIt) {
  int feasible = 0, refused = 0;
  for (const double dead_time_s : {0.02, 0.07, 0.3}) {
    for (const FractionalModel& fluid : {kNonNewtonianModel, kNewtonianModel}) {
      const FractionalModel plant = delayed(fluid, dead_time_s);
      for (const double omega_rad_s : log_spaced(0.2, 40, 6)) {
        for (const double margin_deg : {20.0, 60.0, 100.0}) {
          for (const std::optional<double> mu : {std::optional<double>{}, std::optional<double>{0.9}}) {
            const TuningResult result = tune(plant, {omega_rad_s, margin_deg, mu});
            SCOPED_TRACE(testing::Message() << dead_time_s << " s, " << omega_rad_s << " rad/s, " << margin_deg);
            ++(result.is_feasible ? feasible : refused);
            EXPECT_TRUE(result.is_feasible || !result.nearest.empty() || !result.relaxed.empty()) << result.reason;
            std::vector<TunedController> designs = result.nearest;
            if (result.tuned) designs.push_back(*result.tuned);
            for (const TunedController& design : designs) {
              const OpenLoop loop{plant, design.controller};
              const double asked = design.spec.gain_crossover_rad_s;
              EXPECT_NEAR(std::abs(open_loop_response(loop, asked)), 1, 1e-9);
              const double margin_rad = pi + open_loop_phase_rad(loop, asked);
              EXPECT_NEAR(margin_rad * kDegPerRad, design.spec.phase_margin_deg, 1e-7);
              if (!mu) EXPECT_NEAR(open_loop_phase_slope_s(loop, asked) * asked, 0, 1e-9);
              EXPECT_NEAR(*design.achieved.phase_margin_deg, design.spec.phase_margin_deg, 1e-7);
            }
            if (result.tuned) EXPECT_TRUE(is_stable_by_turns({plant, result.tuned->controller}));
          }
        }
      }
    }
  }
  EXPECT_GT(feasible, 20);
  EXPECT_GT(refused, 20);
}

// The paper's crossover has no iso-damped design with 65 degrees; what it takes without dead time is known. A dead time
// adds its own fall of the phase to R and its own lag to θ.
TEST(DeadTime, TuningDemandsGrowByTheDelaysPhase) {
  const TuningSpec spec{3, 90};
  const TuningResult without = tune(kNonNewtonianModel, spec), with = tune(delayed(kNonNewtonianModel, 0.07), spec);
  EXPECT_NEAR(with.theta_deg - without.theta_deg, 3 * 0.07 * kDegPerRad, 1e-9);
  EXPECT_NEAR(with.phase_fall - without.phase_fall, 3 * 0.07, 1e-12);
}

TEST(DeadTime, AStepResponseIsTheSameSoMuchLater) {
  const std::vector<double> time_s{0, 0.05, 0.07, 0.17, 1.07, 60.07}, earlier_s{0.1, 1, 60};
  const TimeResponse late = step_response(delayed(kNonNewtonianModel, 0.07), 0.3, time_s);
  const TimeResponse prompt = step_response(kNonNewtonianModel, 0.3, earlier_s);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(late.velocity_m_s[i], 0);
    EXPECT_EQ(late.position_m[i], 0);
    EXPECT_NEAR(late.velocity_m_s[i + 3] / prompt.velocity_m_s[i], 1, 1e-12);
    EXPECT_NEAR(late.position_m[i + 3] / prompt.position_m[i], 1, 1e-12);
  }
}

std::vector<double> wandering_duty(std::size_t count) {
  std::vector<double> duty;
  for (std::size_t k = 0; k < count; ++k) duty.push_back(std::sin(0.3 * static_cast<double>(k * k)));
  return duty;
}

// The position at a time as the sum of the steps of a duty that is held between sampling times.
double sum_of_steps(const FractionalModel& model, const std::vector<double>& time_s, const std::vector<double>& duty,
                    double at_s) {
  double position_m = 0, before = 0;
  for (std::size_t k = 0; k < time_s.size(); ++k) {
    const double since_s = at_s - time_s[k];
    if (since_s > 0) position_m += step_response(model, duty[k] - before, std::vector{since_s}).position_m[0];
    before = duty[k];
  }
  return position_m;
}

TEST(DeadTime, ASampledResponseIsTheSumOfStepsSoMuchLater) {
  for (const double dead_time_s : {0.004, 0.03, 0.0333, 0.21}) {
    const FractionalModel model = delayed(kNonNewtonianModel, dead_time_s);
    std::vector<double> time_s;
    for (int k = 0; k < 60; ++k) time_s.push_back(0.01 * k + (k > 30 ? 0.0037 : 0));
    const std::vector<double> duty = wandering_duty(time_s.size());
    const TimeResponse response = sampled_response(model, time_s, duty);
    ASSERT_EQ(response.position_m.size(), time_s.size());
    ASSERT_EQ(response.velocity_m_s.size(), time_s.size());
    for (std::size_t k = 0; k < time_s.size(); k += 7) {
      EXPECT_NEAR(response.position_m[k], sum_of_steps(model, time_s, duty, time_s[k]), 1e-11)
          << dead_time_s << ' ' << k;
    }
  }
}

TEST(DelayLine, HoldsDutiesBackByWholeStepsAndShares) {
  DelayLine none{0, 0.01}, whole{0.02, 0.01}, shared{0.013, 0.01};
  EXPECT_EQ(none.push(5).later, 5);
  std::vector<double> late, earlier, later;
  for (const double duty : {1.0, 2.0, 3.0, 4.0}) {
    late.push_back(whole.push(duty).later);
    const HeldDuty held = shared.push(duty);
    earlier.push_back(held.earlier), later.push_back(held.later);
  }
  EXPECT_THAT(late, ElementsAre(0, 0, 1, 2));
  EXPECT_THAT(later, ElementsAre(0, 1, 2, 3));
  EXPECT_THAT(earlier, ElementsAre(0, 0, 1, 2));
  EXPECT_NEAR(shared.earlier_share(), 0.3, 1e-12);
  EXPECT_EQ(whole.earlier_share(), 0);
  EXPECT_EQ((DelayLine{0.07, 0.01}.earlier_share()), 0);  // 7.000000000000001 steps
  EXPECT_EQ((DelayLine{0.29, 0.01}.earlier_share()), 0);  // 28.999999999999996
  EXPECT_THROW((DelayLine{1e6, 0.01}), std::invalid_argument);
}

TEST(DeadTime, TheModalPlantFollowsTheSampledResponseForAnyShareOfAStep) {
  for (const FractionalModel& fluid : {kNonNewtonianModel, kNewtonianModel}) {
    for (const double dead_time_s : {0.0001, 0.0042, 0.03, 0.0537, 0.0999}) {
      const FractionalModel model = delayed(fluid, dead_time_s);
      ModalPlant plant{model, 0.01};
      std::vector<double> time_s;
      for (int k = 0; k < 400; ++k) time_s.push_back(0.01 * k);
      const std::vector<double> duty = wandering_duty(time_s.size());
      const TimeResponse expected = sampled_response(model, time_s, duty);
      for (int pass = 0; pass < 2; ++pass, plant.reset()) {
        for (std::size_t k = 1; k < time_s.size(); ++k) {
          plant.step(duty[k - 1]);
          ASSERT_NEAR(plant.position_m(), expected.position_m[k], 1e-7) << dead_time_s << ' ' << k;
          ASSERT_NEAR(plant.velocity_m_s(), expected.velocity_m_s[k], 2e-6) << dead_time_s << ' ' << k;
        }
      }
    }
  }
}

// Just below the ultimate gain a delayed loop rings down, just above it grows: predicted as the margins say.
TEST(DeadTime, APredictedLoopIsStableWhereItsMarginsSayAndRobustnessSeesIt) {
  const Discretisation controller = discretise(kPaperController, {});
  for (const double dead_time_s : {0.0, 0.07, 0.3}) {
    const FractionalModel plant = delayed(kNonNewtonianModel, dead_time_s);
    const RobustnessTable table = robustness(plant, controller);
    const bool is_stable = margins({plant, kPaperController}).is_closed_loop_stable;
    EXPECT_EQ(is_stable, dead_time_s < 0.2);
    EXPECT_EQ(table.rows[1].is_stable, is_stable) << dead_time_s;
    EXPECT_EQ(table.rows[3].plant.dead_time_s, dead_time_s);
    EXPECT_EQ(table.rows[3].is_stable, dead_time_s == 0) << dead_time_s;  // water's margin is 31 degrees at 16 rad/s
  }
}

TEST(DeadTime, APredictionBeginsToMoveAfterIt) {
  ClosedLoopExperiment experiment;
  experiment.plant = delayed(kNonNewtonianModel, 0.05);
  experiment.controller = discretise(kPaperController, {}).sections;
  experiment.duration_s = 1;
  const ClosedLoopPrediction prediction = predict_closed_loop(experiment);
  EXPECT_EQ(prediction.position_m[5], 0);
  EXPECT_GT(prediction.position_m[6], 0);
}

TEST(DeadTime, APlannedExperimentIsAsCertainOfALateRecord) {
  PlannedExperiment plan;
  plan.duty = prbs_duty(1, 0.5, 20, 0.01);
  plan.position_sd_m = 1e-3;
  const ExpectedUncertainty prompt = expected_uncertainty(kNonNewtonianModel, plan);
  const ExpectedUncertainty late = expected_uncertainty(delayed(kNonNewtonianModel, 0.0733), plan);
  EXPECT_NEAR(*late.one_sigma[2] / *prompt.one_sigma[2], 1, 0.02);
  EXPECT_NE(*late.one_sigma[2], *prompt.one_sigma[2]);
  plan.duty.assign(100, 0.0);
  plan.duty.front() = 1;
  plan.duty.resize(100);
  EXPECT_FALSE(expected_uncertainty(delayed(kNonNewtonianModel, 5), plan).one_sigma[0]);  // nothing moves in 1 s
}

std::string refusal(auto&& call) {
  try {
    call();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(DeadTime, WhatCannotTakeItSaysSo) {
  const FractionalModel late = delayed(kNonNewtonianModel, 0.07);
  EXPECT_THAT(refusal([&] { ContinuousLoop(late, kPaperController); }), HasSubstr("no dead time, has 0.07"));
  EXPECT_THAT(refusal([&] { grunwald_letnikov_velocity(late, 0.01, std::vector{1.0}); }), HasSubstr("no dead time"));
  EXPECT_THAT(refusal([&] { check(delayed(late, -0.01)); }), HasSubstr("dead_time_s must be 0 or positive, is -0.01"));
  EXPECT_THAT(refusal([&] { check(delayed(late, INFINITY)); }), HasSubstr("dead_time_s"));
  EXPECT_EQ(normalised(delayed(kNewtonianModel, 0.07)).dead_time_s, 0.07);
}

}  // namespace
}  // namespace control
