// The pump's profile is the golden one, its mean is what is set, and the walls smooth it as their time constant says.
#include "sim_robot/world/pump.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "sim_robot/world/tick.hpp"

namespace sim_robot {
namespace {

constexpr int kSevenPeriods = 600;  // ticks
constexpr double kOmegaRadS = 2 * std::numbers::pi / kPumpPeriodS;

std::complex<double> harmonic(int order, int points, auto value) {
  std::complex<double> sum = 0;
  for (int k = 0; k < points; ++k) {
    const double time_s = kPumpPeriodS * (k + 0.5) / points;
    sum += value(time_s) * std::polar(2.0 / points, order * kOmegaRadS * time_s);
  }
  return sum;  // a + i b of a cos + b sin
}

// What 7 periods of a pump have of the frequency of 70 bpm.
std::complex<double> first_harmonic(Pump& pump) {
  std::complex<double> sum = 0;
  for (int k = 1; k <= kSevenPeriods; ++k) {
    pump.step();
    sum += pump.flow_m3_s() * std::polar(2.0 / kSevenPeriods, kOmegaRadS * kTickS * k);
  }
  return sum;
}

double mean_flow(Pump& pump) {
  double sum = 0;
  for (int k = 0; k < kSevenPeriods; ++k) {
    pump.step();
    sum += pump.flow_m3_s() / kSevenPeriods;
  }
  return sum;
}

TEST(PumpProfile, HasTheGoldenPeriodAndHarmonics) {
  const auto golden = nlohmann::json::parse(std::ifstream(TEST_DATA_DIR "/flow_profile.json"));
  EXPECT_NEAR(kPumpPeriodS, golden["period"].get<double>(), 1e-12);
  EXPECT_NEAR(kOmegaRadS, golden["w"].get<double>(), 1e-12);
  constexpr int kPoints = 200'000;
  EXPECT_NEAR(harmonic(0, kPoints, pump_profile).real(), 2, 2e-6);  // the mean is 1
  for (std::size_t n = 0; n < golden["a"].size(); ++n) {
    const auto found = harmonic(static_cast<int>(n) + 1, kPoints, pump_profile);
    EXPECT_NEAR(found.real(), golden["a"][n].get<double>(), 1e-5) << "a" << n + 1;
    EXPECT_NEAR(found.imag(), golden["b"][n].get<double>(), 1e-5) << "b" << n + 1;
  }
}

TEST(PumpProfile, RepeatsAndNeverTurnsRound) {
  for (double time_s = 0; time_s < kPumpPeriodS; time_s += 0.001) {
    EXPECT_NEAR(pump_profile(time_s), pump_profile(time_s + 11 * kPumpPeriodS), 1e-9);
    EXPECT_GE(pump_profile(time_s), 0.4690);
    EXPECT_LE(pump_profile(time_s), 2.3547);
  }
}

TEST(Pump, FollowsTheProfileWithRigidWalls) {
  Pump pump{{.mean_flow_m3_s = 0.001, .compliance_s = 0}};
  EXPECT_NEAR(pump.flow_m3_s(), 0.001 * pump_profile(0), 1e-12);
  for (int k = 1; k <= 3000; ++k) {
    pump.step();
    ASSERT_NEAR(pump.flow_m3_s(), 0.001 * pump_profile(kTickS * (k % kSevenPeriods)), 1e-12) << k;
  }
}

TEST(Pump, WallsSmoothThePulseAsTheirTimeConstantSays) {
  for (const double compliance_s : {0.02, 0.2, 1.0}) {
    Pump rigid{{.mean_flow_m3_s = 0.001, .compliance_s = 0}};
    Pump elastic{{.mean_flow_m3_s = 0.001, .compliance_s = compliance_s}};
    const std::complex<double> ratio = first_harmonic(elastic) / first_harmonic(rigid);
    EXPECT_NEAR(std::abs(ratio), 1 / std::hypot(1, kOmegaRadS * compliance_s), 1e-3) << compliance_s;
    EXPECT_NEAR(std::arg(ratio), std::atan(kOmegaRadS * compliance_s), 1e-3) << compliance_s;  // late
  }
}

TEST(Pump, WallsKeepTheMean) {
  for (const double compliance_s : {0.0, 0.02, 0.5, 5.0}) {
    Pump pump{{.mean_flow_m3_s = kPaperFlowM3S, .compliance_s = compliance_s}};
    EXPECT_NEAR(mean_flow(pump), kPaperFlowM3S, 1e-4 * kPaperFlowM3S) << compliance_s;
  }
}

TEST(Pump, HasBeenOnForLongAtTheStart) {
  Pump pump{{.mean_flow_m3_s = 0.001, .compliance_s = 0.3}};
  const double start = pump.flow_m3_s();
  for (int k = 0; k < kSevenPeriods; ++k) pump.step();
  EXPECT_NEAR(pump.flow_m3_s(), start, 1e-9);
}

TEST(Pump, StartsAndTurnsRoundOverItsRamp) {
  Pump pump{{.mean_flow_m3_s = 0.001, .starts_at_s = 2, .ramp_s = 1, .compliance_s = 0}};
  for (int k = 0; k < 200; ++k) {
    EXPECT_EQ(pump.flow_m3_s(), 0);
    pump.step();
  }
  for (int k = 0; k < 50; ++k) pump.step();
  EXPECT_NEAR(pump.mean_flow_m3_s(), 0.0005, 1e-9);
  for (int k = 0; k < 100; ++k) pump.step();
  EXPECT_NEAR(mean_flow(pump), 0.001, 1e-6);
  pump.set_mean_flow_m3_s(-0.0005);
  EXPECT_NEAR(pump.mean_flow_m3_s(), 0.001, 1e-12);
  for (int k = 0; k < 50; ++k) pump.step();
  EXPECT_NEAR(pump.mean_flow_m3_s(), 0.00025, 1e-9);
  for (int k = 0; k < 50; ++k) pump.step();
  EXPECT_NEAR(mean_flow(pump), -0.0005, 1e-6);
}

TEST(Pump, AConstantFlowHasNoPulse) {
  Pump pump{{.kind = PumpKind::constant, .mean_flow_m3_s = -0.001, .compliance_s = 0.3}};
  for (int k = 0; k < kSevenPeriods; ++k) {
    ASSERT_NEAR(pump.flow_m3_s(), -0.001, 1e-12) << k;
    pump.step();
  }
}

TEST(Pump, ChangesItsKindOverTheRampAndBackIntoThePhaseOfThePulse) {
  Pump pump{{.mean_flow_m3_s = 0.001, .ramp_s = 1, .compliance_s = 0}};
  pump.set_flow(PumpKind::constant, 0.002);
  for (int k = 0; k < 50; ++k) pump.step();
  EXPECT_NEAR(pump.mean_flow_m3_s(), 0.0015, 1e-9);
  EXPECT_NEAR(pump.flow_m3_s(), 0.001 + 0.0005 * pump_profile(50 * kTickS), 1e-9);
  for (int k = 0; k < 50; ++k) pump.step();
  EXPECT_NEAR(pump.flow_m3_s(), 0.002, 1e-12);
  pump.set_mean_flow_m3_s(0.0005);  // of the same kind
  for (int k = 0; k < 100; ++k) pump.step();
  EXPECT_NEAR(pump.flow_m3_s(), 0.0005, 1e-12);
  pump.set_flow(PumpKind::pulse_70_bpm, 0.001);
  for (int k = 0; k < 100; ++k) pump.step();
  EXPECT_NEAR(pump.flow_m3_s(), 0.001 * pump_profile(300 * kTickS), 1e-12);
}

TEST(FlowCsv, IsOnePeriodWithTheMeanThatIsAsked) {
  std::ostringstream out;
  write_flow_csv(out, 0.001, 600);
  std::istringstream lines{out.str()};
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(line, "t_s,flow_m3_s");
  int rows = 0;
  double sum = 0;
  while (std::getline(lines, line)) {
    const std::size_t comma = line.find(',');
    ASSERT_NE(comma, std::string::npos);
    const double time_s = std::stod(line), flow_m3_s = std::stod(line.substr(comma + 1));
    EXPECT_NEAR(time_s, kPumpPeriodS * rows / 600, 1e-8);
    EXPECT_NEAR(flow_m3_s, 0.001 * pump_profile(time_s), 1e-6);
    sum += flow_m3_s;
    ++rows;
  }
  EXPECT_EQ(rows, 600);
  EXPECT_NEAR(sum / rows, 0.001, 1e-6);
  EXPECT_THROW(write_flow_csv(out, 0.001, 1), std::invalid_argument);
}

TEST(Pump, RefusesWhatCannotBe) {
  EXPECT_THROW(check(PumpParameters{.mean_flow_m3_s = 1}), std::invalid_argument);
  EXPECT_THROW(check(PumpParameters{.compliance_s = -1}), std::invalid_argument);
  Pump pump{{}};
  EXPECT_THROW(pump.set_mean_flow_m3_s(std::nan("")), std::invalid_argument);
}

}  // namespace
}  // namespace sim_robot
