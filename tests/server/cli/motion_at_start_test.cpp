// A record that begins in motion causes a warning; one that no sensor can tell from rest causes none.
#include "server/analysis/motion_at_start.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

namespace server::analysis {
namespace {

using testing::HasSubstr;

constexpr std::size_t kSamples = 200;
constexpr double kDtS = 0.01;

std::vector<double> at_speed(double velocity_m_s) {
  std::vector<double> position_m;
  for (std::size_t k = 0; k < kSamples; ++k) position_m.push_back(velocity_m_s * kDtS * static_cast<double>(k));
  return position_m;
}

control::Recording coasting() {
  control::Recording recording;
  recording.dt_s = kDtS;
  recording.duty.assign(kSamples, 0.0);
  return recording;
}

TEST(MotionAtStart, SpeedsThatNoSensorTellsFromRestAreRest) {
  for (const double velocity_m_s : {-4e-15, 1e-9, -9e-7}) {
    control::Recording of_position = coasting(), of_velocity = coasting(), of_acceleration = coasting();
    of_position.position_m = at_speed(velocity_m_s);
    of_velocity.velocity_m_s.assign(kSamples, velocity_m_s);
    of_acceleration.acceleration_m_s2.assign(kSamples, 0.0);
    EXPECT_EQ(motion_at_start(of_position), std::nullopt) << velocity_m_s;
    EXPECT_EQ(motion_at_start(of_velocity), std::nullopt) << velocity_m_s;
    EXPECT_EQ(motion_at_start(of_acceleration, of_velocity.velocity_m_s), std::nullopt) << velocity_m_s;
  }
}

TEST(MotionAtStart, WarnsOfSlowMotionWithItsSpeed) {
  for (const auto& [velocity_m_s, words] : {std::pair{-2e-5, "about -2e-05 m/s"}, {0.05, "about 0.05 m/s"}}) {
    control::Recording of_position = coasting(), of_velocity = coasting();
    of_position.position_m = at_speed(velocity_m_s);
    of_velocity.velocity_m_s.assign(kSamples, velocity_m_s);
    EXPECT_THAT(motion_at_start(of_position).value_or(""), HasSubstr(words));
    EXPECT_THAT(motion_at_start(of_velocity).value_or(""), HasSubstr(words));
  }
}

}  // namespace
}  // namespace server::analysis
