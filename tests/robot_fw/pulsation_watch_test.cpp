// What is a flow, and what an error of the model, of pulsations that are known.
#include "robot_fw/core/pulsation_watch.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

namespace robot_fw {
namespace {

constexpr float kTickS = 0.01F;
constexpr PulsationWatch::Allowed kNothing, kAllowed{0.2F, 0.025F};

// A velocity of that amplitude and frequency.
double sine(double amplitude_m_s, double hz, double time_s) {
  return amplitude_m_s * std::sin(2 * std::numbers::pi * hz * time_s);
}

PulsationWatch watched(const std::function<double(double time_s)>& unexplained_m_s,
                       const std::function<double(double time_s)>& explained_m_s,
                       const PulsationWatch::Allowed& allowed, double seconds = 10) {
  PulsationWatch watch;
  for (int tick = 1; tick * 0.01 <= seconds; ++tick) {
    const auto change = [tick](const auto& velocity) {
      return static_cast<float>(velocity(tick * 0.01) - velocity((tick - 1) * 0.01));
    };
    watch.step(change(unexplained_m_s), change(explained_m_s), kTickS, allowed);
  }
  return watch;
}

double motor(double time_s) { return sine(0.1, 1, time_s); }
double pump(double time_s) { return sine(0.02, 0.7, time_s); }

TEST(PulsationWatchTest, WithoutAnAllowedErrorAllThatIsUnexplainedIsAFlow) {
  const auto half = watched([](double t) { return 0.15 * motor(t); }, motor, kNothing);
  EXPECT_NEAR(half.flow_m_s(), 0.015 / std::numbers::sqrt2, 0.001);
  EXPECT_EQ(half.misfit(), 0);
}

TEST(PulsationWatchTest, AGainThatIsOffIsTheModelsErrorUpToTheBound) {
  const auto within = watched([](double t) { return 0.15 * motor(t); }, motor, kAllowed);
  EXPECT_EQ(within.flow_m_s(), 0);
  EXPECT_NEAR(std::sqrt(within.misfit()), 0.15, 0.01);
  const auto beyond = watched([](double t) { return 0.5 * motor(t); }, motor, kAllowed);
  EXPECT_NEAR(beyond.flow_m_s(), 0.03 / std::numbers::sqrt2, 0.005) << "what 0.2 of it leaves";
}

TEST(PulsationWatchTest, ALagIsTheModelsError) {
  const auto late = watched([](double t) { return motor(t - 0.02) - motor(t); }, motor, kAllowed);
  EXPECT_EQ(late.flow_m_s(), 0);
  EXPECT_GT(late.misfit(), 0.005);
}

// Beside five times as strong a motor of a like frequency it can be hidden: decision 0092.
TEST(PulsationWatchTest, APumpIsAFlowBesideAMotorThatPulsatesTwiceAsStrongly) {
  for (const double hz : {0.3, 1.0, 3.0}) {
    const auto watch = watched(pump, [hz](double t) { return sine(0.04, hz, t); }, kAllowed);
    EXPECT_GT(watch.flow_m_s(), 0.004) << hz;
  }
  EXPECT_GT(watched(pump, [](double) { return 0.0; }, kAllowed).flow_m_s(), 0.012) << "at rest";
}

TEST(PulsationWatchTest, WhatEndsWithinThreeWindowsIsNeither) {
  const auto watch = watched([](double t) { return t < 1 ? 0.5 * motor(t) : 0; }, motor, kAllowed, 3.5);
  EXPECT_EQ(watch.flow_m_s(), 0);
  EXPECT_NEAR(watch.misfit(), 0, 1e-4);
}

}  // namespace
}  // namespace robot_fw
