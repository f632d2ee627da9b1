// Duties over time against their definitions.
#include "server/experiments/duty_signals.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>

#include "tests/server/experiments/steps.hpp"

namespace server::experiments {
namespace {

using ::testing::ElementsAre;

// The duty at every tick.
std::vector<double> sampled(const Step& step) {
  const std::vector<DutyChange> changes = duty_changes(step);
  std::vector<double> duty;
  std::size_t next = 0;
  for (std::uint64_t tick = 0; tick < ticks_of(step); ++tick) {
    if (next < changes.size() && changes[next].tick == tick) ++next;
    duty.push_back(changes.at(next - 1).duty);
  }
  return duty;
}

// Amplitude of one frequency in a signal of whole periods.
double amplitude_at(const std::vector<double>& signal, double frequency_hz) {
  std::complex<double> sum = 0;
  for (std::size_t k = 0; k < signal.size(); ++k) {
    sum += signal[k] * std::polar(1.0, -2 * std::numbers::pi * frequency_hz * static_cast<double>(k) * kTick_s);
  }
  return 2 * std::abs(sum) / static_cast<double>(signal.size());
}

// At its end the next step begins: a second duty for the same tick would be refused by the robot.
TEST(DutySignals, NothingChangesAtTheEndOfAStep) {
  Step step = step_of(StepKind::prbs, 0);
  step.amplitude = 0.6;
  step.bit_s = 0.2;
  step.every_s = 0.2;
  step.from_duty = step.from_hz = 0.1;
  step.to_duty = step.to_hz = 0.5;
  for (const StepKind kind :
       {StepKind::prbs, StepKind::chirp, StepKind::multisine, StepKind::ramp, StepKind::staircase}) {
    step.kind = kind;
    for (int bits = 60; bits < 90; ++bits) {
      step.for_s = 0.2 * bits;
      EXPECT_LT(duty_changes(step).back().tick, ticks_of(step)) << step_kinds()[static_cast<std::size_t>(kind)] << bits;
    }
  }
}

TEST(DutySignals, AStaircaseHasItsLevelsForEqualTimes) {
  Step step = step_of(StepKind::staircase, 3);
  step.from_duty = -0.2;
  step.to_duty = 0.2;
  step.levels = 3;
  EXPECT_THAT(duty_changes(step), ElementsAre(DutyChange{0, -0.2}, DutyChange{100, 0}, DutyChange{200, 0.2}));
}

TEST(DutySignals, ARampIsHeldBetweenItsValues) {
  Step step = step_of(StepKind::ramp, 1);
  step.from_duty = 0;
  step.to_duty = 0.5;
  step.every_s = 0.25;
  EXPECT_THAT(duty_changes(step),
              ElementsAre(DutyChange{0, 0}, DutyChange{25, 0.125}, DutyChange{50, 0.25}, DutyChange{75, 0.375}));
}

TEST(DutySignals, RestAndDutyAreOneValue) {
  EXPECT_THAT(duty_changes(step_of(StepKind::rest, 2)), ElementsAre(DutyChange{0, 0}));
  Step step = step_of(StepKind::duty, 2);
  step.duty = 0.3;
  EXPECT_THAT(duty_changes(step), ElementsAre(DutyChange{0, 0.3}));
}

// (1): the frequency at a time is what the upward crossings of its mean show.
TEST(DutySignals, AChirpGoesFromItsFirstFrequencyToItsLast) {
  Step step = step_of(StepKind::chirp, 60);
  step.amplitude = 0.4;
  step.mean_duty = 0.1;
  step.from_hz = 0.2;
  step.to_hz = 2;
  step.every_s = 0.02;
  const std::vector<double> duty = sampled(step);
  std::vector<double> crossings_s;
  for (std::size_t k = 1; k < duty.size(); ++k) {
    if (duty[k - 1] <= 0.1 && duty[k] > 0.1) crossings_s.push_back(static_cast<double>(k) * kTick_s);
  }
  EXPECT_NEAR(1 / (crossings_s[1] - crossings_s[0]), 0.2, 0.04);
  EXPECT_NEAR(1 / (crossings_s.back() - *(crossings_s.end() - 2)), 2, 0.1);
  EXPECT_NEAR(*std::ranges::max_element(duty), 0.5, 1e-3);
  EXPECT_NEAR(*std::ranges::min_element(duty), -0.3, 1e-3);
}

TEST(DutySignals, AMultisineHasItsTonesOfOneSizeAndNothingElse) {
  Step step = step_of(StepKind::multisine, 20);
  step.amplitude = 0.5;
  step.from_hz = 0.1;
  step.to_hz = 1;
  step.tones = 5;
  step.every_s = 0.02;
  const std::vector<double> tones_hz = tone_frequencies_hz(step);
  ASSERT_EQ(tones_hz.size(), 5U);
  EXPECT_DOUBLE_EQ(tones_hz.front(), 0.1);
  EXPECT_DOUBLE_EQ(tones_hz.back(), 1);
  const std::vector<double> duty = sampled(step);
  const double first = amplitude_at(duty, tones_hz.front());
  for (const double tone_hz : tones_hz) {
    EXPECT_DOUBLE_EQ(std::round(tone_hz * 20), tone_hz * 20) << "whole periods";
    EXPECT_NEAR(amplitude_at(duty, tone_hz), first, 0.01 * first);
  }
  EXPECT_LT(amplitude_at(duty, 0.7), 0.01 * first);
  double peak = 0;
  for (const double each : duty) peak = std::max(peak, std::abs(each));
  EXPECT_DOUBLE_EQ(peak, 0.5);
  EXPECT_GT(first, 0.5 / 5) << "the phases leave the peak below the sum of the tones";
}

TEST(DutySignals, TonesThatFallTogetherAreOne) {
  Step step = step_of(StepKind::multisine, 2);
  step.from_hz = 0.5;
  step.to_hz = 1;
  step.tones = 10;
  EXPECT_THAT(tone_frequencies_hz(step), ElementsAre(0.5, 1));
}

TEST(DutySignals, APrbsChangesNoFasterThanItsBit) {
  Step step = step_of(StepKind::prbs, 60);
  step.amplitude = 0.3;
  step.mean_duty = 0.2;
  step.bit_s = 0.2;
  const std::vector<DutyChange> changes = duty_changes(step);
  EXPECT_GT(changes.size(), 100U);
  for (std::size_t i = 0; i < changes.size(); ++i) {
    EXPECT_TRUE(changes[i].duty == 0.5 || std::abs(changes[i].duty + 0.1) < 1e-12) << changes[i].duty;
    EXPECT_EQ(changes[i].tick % 20, 0U);
    if (i > 0) EXPECT_NE(changes[i].duty, changes[i - 1].duty);
  }
}

}  // namespace
}  // namespace server::experiments
