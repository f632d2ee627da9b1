// The electrode adds noise, offset and drift to the truth, and fails as it is told.
#include "sim_robot/world/electrode.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

namespace sim_robot {
namespace {

struct Spread {
  double mean = 0, sd = 0;
};

Spread spread_of(Electrode& electrode) {
  constexpr int kReadings = 20'000;
  double sum = 0, squares = 0;
  for (int k = 0; k < kReadings; ++k) {
    const double off_mv = electrode.read(175) - 175;
    sum += off_mv;
    squares += off_mv * off_mv;
  }
  const double mean = sum / kReadings;
  return {mean, std::sqrt(squares / kReadings - mean * mean)};
}

TEST(Electrode, MeasuresExactlyByDefault) {
  Electrode electrode{{}, 1};
  electrode.step();
  EXPECT_EQ(electrode.read(175), 175);
  EXPECT_EQ(electrode.read(120), 120);
}

TEST(Electrode, HasTheNoiseAndTheOffsetThatItIsGiven) {
  Electrode electrode{{.noise_mv = 2, .offset_mv = -3}, 1};
  const Spread spread = spread_of(electrode);
  EXPECT_NEAR(spread.mean, -3, 0.05);
  EXPECT_NEAR(spread.sd, 2, 0.05);
}

TEST(Electrode, Drifts) {
  Electrode electrode{{.drift_mv_s = 0.1}, 1};
  for (int k = 0; k < 3000; ++k) electrode.step();
  EXPECT_NEAR(electrode.read(175), 178, 1e-9);
}

TEST(Electrode, IsTheSameForTheSameSeedAndAnotherForAnother) {
  Electrode one{kDs550, 1}, same{kDs550, 1}, other{kDs550, 2};
  const double first = one.read(175);
  EXPECT_EQ(first, same.read(175));
  EXPECT_NE(first, other.read(175));
}

TEST(Electrode, IsStuckAtItsLastReadingUntilTheFaultEnds) {
  Electrode electrode{{}, 1};
  EXPECT_EQ(electrode.read(150), 150);
  electrode.set_fault({.kind = SensorFaultKind::stuck});
  EXPECT_EQ(electrode.read(120), 150);
  EXPECT_EQ(electrode.read(175), 150);
  electrode.set_fault({});
  EXPECT_EQ(electrode.read(175), 175);
}

TEST(Electrode, ThatIsMissingReads0) {
  Electrode electrode{{}, 1};
  electrode.set_fault({.kind = SensorFaultKind::missing});
  EXPECT_EQ(electrode.read(175), 0);
}

TEST(Electrode, CanBeOffOrNoisyOnTop) {
  Electrode electrode{{}, 1};
  electrode.set_fault({SensorFaultKind::offset, 40});
  EXPECT_EQ(electrode.read(175), 215);
  electrode.set_fault({SensorFaultKind::noisy, 10});
  EXPECT_NEAR(spread_of(electrode).sd, 10, 0.3);
}

TEST(Electrode, RefusesWhatCannotBe) {
  EXPECT_THROW(check(ElectrodeParameters{.noise_mv = -1}), std::invalid_argument);
  EXPECT_THROW(check(SensorFault{SensorFaultKind::noisy, -1}), std::invalid_argument);
  EXPECT_THROW(check(SensorFault{SensorFaultKind::offset, std::nan("")}), std::invalid_argument);
}

}  // namespace
}  // namespace sim_robot
