// Two records of one motion, on clocks that differ by a known time.
#include "control/sensor/clock_alignment.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "control/identification/identify.hpp"
#include "control/models/modal_plant.hpp"

namespace control {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kTickS = 0.01;

struct Record {
  std::vector<double> time_s, position_m;
  operator PositionRecord() const { return {time_s, position_m}; }
};

// What a robot's own record says: the position at each tick.
Record swim(const std::vector<double>& duty) {
  ModalPlant plant{kNonNewtonianModel, kTickS};
  Record record;
  for (std::size_t k = 0; k < duty.size(); ++k) {
    record.time_s.push_back(kTickS * static_cast<double>(k));
    record.position_m.push_back(plant.position_m());
    plant.step(duty[k]);
  }
  return record;
}

double between(const Record& record, double at_s) {
  const auto k = static_cast<std::size_t>(at_s / kTickS);
  return std::lerp(record.position_m.at(k), record.position_m.at(k + 1), at_s / kTickS - static_cast<double>(k));
}

struct Camera {
  double rate_hz = 30;
  double clock_ahead_s = 0;  // what it calls 0 is this time of the robot's
  double zero_m = 0.37;
  double noise_sd_m = 0.0005;
  double from_s = 0.1, to_s = 59;  // of the robot's clock
};

Record watch(const Record& truth, const Camera& camera, unsigned seed) {
  std::mt19937 random{seed};
  std::normal_distribution<double> noise{0, camera.noise_sd_m};
  Record seen;
  for (double at_s = camera.from_s; at_s < camera.to_s; at_s += 1 / camera.rate_hz) {
    seen.time_s.push_back(at_s - camera.clock_ahead_s);
    seen.position_m.push_back(between(truth, at_s) + camera.zero_m + noise(random));
  }
  return seen;
}

Record prbs_swim() { return swim(prbs_duty(0.6, 0.5, 60, kTickS)); }

TEST(ClockAlignment, FindsAKnownOffsetWithinThreeSigmasAtTheRatesOfCameras) {
  const Record robot = prbs_swim();
  for (const double rate_hz : {25.0, 30.0, 60.0}) {
    int within_two = 0;
    for (unsigned seed = 0; seed < 12; ++seed) {
      const Camera camera{.rate_hz = rate_hz, .clock_ahead_s = 3.2 + 0.0137 * seed, .from_s = 0.1 + 0.003 * seed};
      const ClockAlignment found = align_clocks(watch(robot, camera, seed), robot);
      ASSERT_THAT(found.refusal, IsEmpty());
      const double error_s = found.offset_s - camera.clock_ahead_s;
      EXPECT_LT(std::abs(error_s), 3 * found.offset_sd_s) << rate_hz << " Hz, seed " << seed;
      EXPECT_LT(found.offset_sd_s, 0.003);
      EXPECT_NEAR(found.motion_ratio, 1, 0.01);
      EXPECT_GT(found.correlation, 0.99);
      within_two += std::abs(error_s) < 2 * found.offset_sd_s ? 1 : 0;
    }
    EXPECT_GE(within_two, 9) << rate_hz;
  }
}

TEST(ClockAlignment, ARobotThatIsWrongAboutItsPositionIsStillRightAboutTheTime) {
  const Record truth = prbs_swim();
  Record belief = truth;
  for (std::size_t k = 0; k < belief.time_s.size(); ++k) {
    belief.position_m[k] = 0.93 * belief.position_m[k] + 0.02 * std::sin(belief.time_s[k] / 8);  // slow, as drift is
  }
  const Camera camera{.clock_ahead_s = -7.654};
  const ClockAlignment found = align_clocks(watch(truth, camera, 5), belief);
  ASSERT_THAT(found.refusal, IsEmpty());
  EXPECT_NEAR(found.offset_s, -7.654, std::max(0.004, 3 * found.offset_sd_s));
  EXPECT_NEAR(found.motion_ratio, 1 / 0.93, 0.03);
}

TEST(ClockAlignment, ACameraThatSawOnlyAPartOrHasGapsIsEnough) {
  const Record robot = prbs_swim();
  const Camera late{.clock_ahead_s = 100.25, .from_s = 31, .to_s = 52};
  const ClockAlignment part = align_clocks(watch(robot, late, 1), robot);
  ASSERT_THAT(part.refusal, IsEmpty());
  EXPECT_NEAR(part.offset_s, 100.25, 3 * part.offset_sd_s);

  Record lost = watch(robot, {.clock_ahead_s = 1.5}, 2);
  lost.time_s.erase(lost.time_s.begin() + 400, lost.time_s.begin() + 900);
  lost.position_m.erase(lost.position_m.begin() + 400, lost.position_m.begin() + 900);
  const ClockAlignment around = align_clocks(lost, robot);
  ASSERT_THAT(around.refusal, IsEmpty());
  EXPECT_NEAR(around.offset_s, 1.5, 3 * around.offset_sd_s);
}

TEST(ClockAlignment, RefusesWithoutMotion) {
  const Record robot = swim(std::vector<double>(3000, 0.0));
  const ClockAlignment found = align_clocks(watch(robot, {.to_s = 29}, 1), robot);
  EXPECT_THAT(found.refusal, HasSubstr("by its own record the robot moves by at most 0 mm"));
}

TEST(ClockAlignment, RefusesMotionsThatDoNotBelongTogether) {
  const Record other = swim(prbs_duty(0.6, 0.31, 60, kTickS));
  Record backwards = other;
  for (double& position_m : backwards.position_m) position_m = -position_m;
  const ClockAlignment found = align_clocks(watch(backwards, {}, 1), prbs_swim(), {-5, 5});
  EXPECT_THAT(found.refusal, HasSubstr("resemble each other too little"));
}

TEST(ClockAlignment, RefusesAMotionThatRepeatsUnlessTheRangeLeavesOneOffset) {
  std::vector<double> duty;
  for (int k = 0; k < 6000; ++k) duty.push_back(k / 300 % 2 == 0 ? 0.5 : -0.5);  // every 6 s the same
  const Record robot = swim(duty);
  const Record seen = watch(robot, {.clock_ahead_s = 2}, 1);
  EXPECT_THAT(align_clocks(seen, robot).refusal, HasSubstr("the motion repeats itself"));
  const ClockAlignment near = align_clocks(seen, robot, {0, 4});
  ASSERT_THAT(near.refusal, IsEmpty());
  EXPECT_NEAR(near.offset_s, 2, 3 * near.offset_sd_s);
}

// A speed that does not change looks alike at every offset.
TEST(ClockAlignment, RefusesAnEvenSpeed) {
  Record robot;
  for (int k = 0; k < 3000; ++k) {
    robot.time_s.push_back(kTickS * k);
    robot.position_m.push_back(0.001 * k);
  }
  for (const double noise_sd_m : {1e-9, 0.0005}) {
    const ClockAlignment found = align_clocks(watch(robot, {.noise_sd_m = noise_sd_m, .to_s = 29}, 1), robot);
    EXPECT_THAT(found.refusal, HasSubstr("the speed changes too little")) << noise_sd_m;
  }
}

TEST(ClockAlignment, RefusesRecordsThatAreTooShortAndTimesThatDoNotAscend) {
  const Record robot = prbs_swim();
  EXPECT_THAT(align_clocks(watch(robot, {.to_s = 0.9}, 1), robot).refusal, HasSubstr("more than 1 s"));
  Record turned = watch(robot, {}, 1);
  std::swap(turned.time_s[5], turned.time_s[6]);
  EXPECT_THROW(align_clocks(turned, robot), std::invalid_argument);
  turned = watch(robot, {}, 1);
  turned.position_m.pop_back();
  EXPECT_THROW(align_clocks(turned, robot), std::invalid_argument);
}

}  // namespace
}  // namespace control
