// The estimate of a robot's clock, against robots whose clock is known.
#include "server/station/state/clock_sync.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <ostream>
#include <random>
#include <string>
#include <tuple>

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

// The delays of a network, each way by itself.
struct Network {
  const char* name = "";
  double there_us = 0, back_us = 0;  // at least
  double more_us = 0;                // on average
  double held_up = 0;                // of all, so many take ten times as long
};
void PrintTo(const Network& network, std::ostream* out) { *out << network.name; }
constexpr Network kNear{"Near", 150, 150, 400, 0.3};
constexpr Network kFar{"Far", 5'000, 60'000, 20'000, 0.1};  // and uneven

class ClockSyncTest : public ::testing::Test {
 protected:
  ClockSyncTest(double drift_ppm, const Network& network)
      : clock_{.booted_at_us = 40 * kSecondUs, .drift_ppm = drift_ppm}, network_{network} {}

  station::ClockExchange next(std::int64_t sent_at_us) {
    return exchange(clock_, sent_at_us, delay_us(network_.there_us), 2000, delay_us(network_.back_us));
  }
  std::int64_t delay_us(double least_us) {
    const double delay_us = std::exponential_distribution{1 / network_.more_us}(random_) + least_us;
    return static_cast<std::int64_t>(std::bernoulli_distribution{network_.held_up}(random_) ? 10 * delay_us : delay_us);
  }
  // How many of the sample times of the second after an exchange lie outside of what is stated of them: live ones, and
  // those of the robot's ring up to 8 s before.
  int outside(std::int64_t exchanged_at_us) const {
    const station::ClockEstimate& estimate = sync_.estimate();
    int count = 0;
    for (std::int64_t at_us = exchanged_at_us - 8 * kSecondUs; at_us < exchanged_at_us + kSecondUs; at_us += 10'000) {
      const auto robot_us = static_cast<std::uint64_t>(clock_.robot_us(at_us));
      count += std::abs(estimate.offset_us - clock_.offset_us(at_us)) > estimate.uncertainty_us(robot_us);
    }
    return count;
  }
  std::int64_t stated_us(std::int64_t steady_us) const {
    return sync_.estimate().uncertainty_us(static_cast<std::uint64_t>(clock_.robot_us(steady_us)));
  }

  std::mt19937_64 random_{7};
  TrueClock clock_;
  Network network_;
  station::ClockSync sync_;
};

class PromisedClockTest : public ClockSyncTest, public ::testing::WithParamInterface<std::tuple<double, Network>> {
 protected:
  PromisedClockTest() : ClockSyncTest{std::get<0>(GetParam()), std::get<1>(GetParam())} {}
};

TEST_P(PromisedClockTest, IsNeverMoreWrongThanItSaysFromTheFirstExchangeOn) {
  int count = 0;
  for (std::int64_t steady_us = 50 * kSecondUs; steady_us < 350 * kSecondUs; steady_us += kSecondUs) {
    const station::ClockExchange exchange = next(steady_us);
    sync_.add(exchange);
    count += outside(exchange.answer_received_at_us);
  }
  EXPECT_EQ(count, 0) << "of " << 300 * 900;
}

INSTANTIATE_TEST_SUITE_P(Drifts, PromisedClockTest,
                         ::testing::Combine(::testing::Values(-1000.0, -300.0, -100.0, -30.0, 0.0, 50.0, 100.0, 300.0,
                                                              1000.0),
                                            ::testing::Values(kNear, kFar)),
                         [](const auto& of) {
                           const double ppm = std::get<0>(of.param);
                           return std::string{std::get<1>(of.param).name} + (ppm < 0 ? "Slow" : "Fast") +
                                  std::to_string(std::abs(std::lround(ppm)));
                         });

class NearClockTest : public ClockSyncTest, public ::testing::WithParamInterface<double> {
 protected:
  NearClockTest() : ClockSyncTest{GetParam(), kNear} {}
  void exchange_for(std::int64_t seconds) {
    for (std::int64_t i = 0; i < seconds; ++i) sync_.add(next((50 + i) * kSecondUs));
  }
};

TEST_P(NearClockTest, FindsTheDriftWithinTenPpmAfterAMinute) {
  exchange_for(61);
  EXPECT_NEAR(sync_.estimate().drift_ppm, -clock_.drift_ppm, 10);  // a clock that runs fast loses offset
}

// Nor is it less certain than it must be: as a crystal's clock, or 40 ppm above what is true.
TEST_P(NearClockTest, GrowsNoFasterThanTheDriftThatIsPossible) {
  exchange_for(30);
  EXPECT_LE(sync_.estimate().most_drift_ppm, std::max(100.0, std::abs(clock_.drift_ppm) + 70));
  exchange_for(61);
  EXPECT_LE(sync_.estimate().most_drift_ppm, std::max(100.0, std::abs(clock_.drift_ppm) + 40));
  EXPECT_LE(stated_us(112 * kSecondUs), std::abs(clock_.drift_ppm) <= 100 ? 3000 : 5000);
}

INSTANTIATE_TEST_SUITE_P(Drifts, NearClockTest, ::testing::Values(-1000.0, -100.0, -30.0, 0.0, 50.0, 100.0, 300.0));

class FallibleClockTest : public ClockSyncTest {
 protected:
  FallibleClockTest() : ClockSyncTest{0, kNear} {}
};

// Far outside what docs/protocol.md promises: right as soon as two exchanges have shown it.
TEST_F(FallibleClockTest, AClockThatIsWorseThanPromisedIsStatedAsItWasMeasured) {
  clock_.drift_ppm = 20'000;
  int count = 0;
  for (std::int64_t i = 0; i < 100; ++i) {
    const station::ClockExchange exchange = next((50 + i) * kSecondUs);
    sync_.add(exchange);
    const int now = outside(exchange.answer_received_at_us);
    if (i == 0) EXPECT_GT(now, 0);
    if (i > 0) count += now;
  }
  EXPECT_EQ(count, 0);
  EXPECT_NEAR(sync_.estimate().drift_ppm, -20'000 / 1.02, 10);
}

TEST_F(FallibleClockTest, AfterAJumpOnlyTheNewestExchangeCounts) {
  for (std::int64_t i = 0; i < 60; ++i) sync_.add(next((50 + i) * kSecondUs));
  ASSERT_EQ(sync_.estimate().most_drift_ppm, 100);
  clock_.booted_at_us -= 2 * kSecondUs;                               // its clock shows 2 s more
  sync_.add(exchange(clock_, 110 * kSecondUs, 5'000, 2'000, 9'000));  // worse than those before
  const std::int64_t now_us = 110 * kSecondUs + 16'000;
  EXPECT_LE(std::abs(sync_.estimate().offset_us - clock_.offset_us(now_us)), stated_us(now_us));
  EXPECT_LE(stated_us(now_us), 7'100);
  EXPECT_EQ(sync_.estimate().drift_ppm, 0) << "not measured";
  EXPECT_GE(sync_.estimate().most_drift_ppm, 1000) << "until it is measured again";
  for (std::int64_t i = 0; i < 30; ++i) sync_.add(next((111 + i) * kSecondUs));
  EXPECT_EQ(sync_.estimate().most_drift_ppm, 100);
}

// As when a room warms up by 20 degrees within minutes.
TEST_F(FallibleClockTest, ADriftThatMovesSlowlyForgetsNothing) {
  for (std::int64_t i = 0; i < 600; ++i) {
    const std::int64_t sent_at_us = (50 + i) * kSecondUs;
    const double before_us = static_cast<double>(sent_at_us - clock_.booted_at_us);
    const double shown_us = before_us * (1 + clock_.drift_ppm * 1e-6);
    clock_.drift_ppm += 0.05;  // 30 ppm in 10 minutes, without a step of what it shows
    clock_.booted_at_us = sent_at_us - std::llround(shown_us / (1 + clock_.drift_ppm * 1e-6));
    const station::ClockExchange exchange = next(sent_at_us);
    sync_.add(exchange);
    ASSERT_EQ(outside(exchange.answer_received_at_us), 0) << i;
    if (i > 30) ASSERT_LE(sync_.estimate().most_drift_ppm, 110) << i;
  }
}

TEST(ClockEstimateTest, IsLessCertainTheFurtherASampleIsFromTheExchange) {
  station::ClockSync sync;
  sync.add(exchange({}, 10 * kSecondUs, 100, 0, 100));
  const station::ClockEstimate& estimate = sync.estimate();
  const auto measured_us = static_cast<std::uint64_t>(10 * kSecondUs + 100);
  EXPECT_EQ(estimate.measured_at_robot_us, measured_us);
  EXPECT_NEAR(static_cast<double>(estimate.uncertainty_us(measured_us)), 100, 1);
  // By the most that docs/protocol.md lets a clock drift, until it is measured.
  EXPECT_NEAR(static_cast<double>(estimate.uncertainty_us(measured_us - 8 * kSecondUs)), 100 + 8008, 2);
  EXPECT_NEAR(static_cast<double>(estimate.uncertainty_us(measured_us + 8 * kSecondUs)), 100 + 8008, 2);
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

TEST(ClockEstimateTest, TimesFarBeyondAnyRobotsOverflowNothing) {
  constexpr std::int64_t kFarUs = (std::int64_t{1} << 62) - 1;
  station::ClockSync sync;
  sync.add(exchange({}, 10 * kSecondUs, 100, 0, 100));
  sync.add({.sent_at_us = 11 * kSecondUs,
            .received_at_robot_us = kFarUs,
            .answered_at_robot_us = kFarUs,
            .answer_received_at_us = 11 * kSecondUs + 200});
  EXPECT_EQ(sync.estimate().uncertainty_us(0), 1'000'000'000'000'000);
}

}  // namespace
}  // namespace server
