// The estimate of a robot's clock, against robots whose clock is known.
#include "server/station/state/clock_sync.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace server {
namespace {

constexpr std::int64_t kSecondUs = 1'000'000;

// A robot that booted at some time of the station, with a clock that is wrong by so many ppm.
struct TrueClock {
  std::int64_t booted_at_us = 0;
  double drift_ppm = 0;

  std::int64_t robot_us(std::int64_t steady_us) const {
    const auto since_us = static_cast<double>(steady_us - booted_at_us);
    return static_cast<std::int64_t>(std::llround(since_us * (1 + drift_ppm * 1e-6)));
  }
  // What an estimate should say at this moment.
  std::int64_t offset_us(std::int64_t steady_us) const { return steady_us - robot_us(steady_us); }
};

station::ClockExchange exchange(const TrueClock& clock, std::int64_t sent_at_us, std::int64_t there_us,
                                std::int64_t held_us, std::int64_t back_us) {
  return {.sent_at_us = sent_at_us,
          .received_at_robot_us = clock.robot_us(sent_at_us + there_us),
          .answered_at_robot_us = clock.robot_us(sent_at_us + there_us + held_us),
          .answer_received_at_us = sent_at_us + there_us + held_us + back_us};
}

// Ten minutes of exchanges, each way delayed by itself, three in ten by ten times as much.
class ClockSyncTest : public ::testing::TestWithParam<double> {
 protected:
  station::ClockExchange next(std::int64_t sent_at_us) {
    return exchange(clock_, sent_at_us, delay_us(), 2000, delay_us());
  }
  std::int64_t delay_us() {
    const double delay_us = std::exponential_distribution{1.0 / 400}(random_) + 150;
    return static_cast<std::int64_t>(std::bernoulli_distribution{0.3}(random_) ? 10 * delay_us : delay_us);
  }

  std::mt19937_64 random_{7};
  TrueClock clock_{.booted_at_us = 40 * kSecondUs, .drift_ppm = GetParam()};
  station::ClockSync sync_;
};

TEST_P(ClockSyncTest, IsNeverMoreWrongThanItSays) {
  for (std::int64_t steady_us = 50 * kSecondUs; steady_us < 650 * kSecondUs; steady_us += kSecondUs) {
    sync_.add(next(steady_us));
    const station::ClockEstimate& estimate = sync_.estimate();
    for (const std::int64_t ago_us : {0L, 1L * kSecondUs, 8L * kSecondUs}) {  // live, and from the robot's ring
      const std::int64_t then_us = steady_us - ago_us;
      const auto robot_us = static_cast<std::uint64_t>(clock_.robot_us(then_us));
      ASSERT_LE(std::abs(estimate.offset_us - clock_.offset_us(then_us)), estimate.uncertainty_us(robot_us))
          << "at " << steady_us << ", " << ago_us << " ago";
    }
  }
  const auto robot_us = static_cast<std::uint64_t>(clock_.robot_us(650 * kSecondUs));
  EXPECT_LE(sync_.estimate().uncertainty_us(robot_us), 3000);  // quick exchanges count, delayed ones do not
}

TEST_P(ClockSyncTest, FindsTheDriftWithinTenPpmAfterAMinute) {
  for (std::int64_t steady_us = 50 * kSecondUs; steady_us < 111 * kSecondUs; steady_us += kSecondUs) {
    sync_.add(next(steady_us));
  }
  EXPECT_NEAR(sync_.estimate().drift_ppm, -clock_.drift_ppm, 10);  // a clock that runs fast loses offset
}

INSTANTIATE_TEST_SUITE_P(Drifts, ClockSyncTest, ::testing::Values(-100.0, -30.0, 0.0, 50.0, 100.0));

TEST(ClockEstimateTest, IsLessCertainTheFurtherASampleIsFromTheExchange) {
  station::ClockSync sync;
  sync.add(exchange({}, 10 * kSecondUs, 100, 0, 100));
  const station::ClockEstimate& estimate = sync.estimate();
  const auto measured_us = static_cast<std::uint64_t>(10 * kSecondUs + 100);
  EXPECT_EQ(estimate.measured_at_robot_us, measured_us);
  EXPECT_NEAR(static_cast<double>(estimate.uncertainty_us(measured_us)), 100, 1);
  EXPECT_NEAR(static_cast<double>(estimate.uncertainty_us(measured_us - 8 * kSecondUs)), 100 + 800, 1);
  EXPECT_NEAR(static_cast<double>(estimate.uncertainty_us(measured_us + 8 * kSecondUs)), 100 + 800, 1);
}

TEST(ClockEstimateTest, AnExchangeThatCannotBeChangesNothing) {
  station::ClockSync sync;
  sync.add(
      {.sent_at_us = 5000, .received_at_robot_us = 900, .answered_at_robot_us = 800, .answer_received_at_us = 6000});
  sync.add(
      {.sent_at_us = 5000, .received_at_robot_us = 800, .answered_at_robot_us = 2800, .answer_received_at_us = 6000});
  sync.add({.sent_at_us = 5000, .received_at_robot_us = -5, .answered_at_robot_us = 10, .answer_received_at_us = 6000});
  EXPECT_FALSE(sync.estimate().valid);
}

}  // namespace
}  // namespace server
