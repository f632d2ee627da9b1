// Figure 6: the Bode diagram of the open loop, and what it says of the printed specification.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "control/tuning/tune.hpp"
#include "tests/control/figures.hpp"

namespace control {
namespace {

constexpr OpenLoop kPositionLoop{kNonNewtonianModel, kPaperController};
constexpr OpenLoop kVelocityLoop{kNonNewtonianModel, kPaperController, true};
constexpr double kPrintedCrossoverRadS = 65, kPrintedMarginDeg = 72;

nlohmann::json golden() { return nlohmann::json::parse(std::ifstream(TEST_DATA_DIR "/bode_open_loop.json")); }

BodePoint point_at(const OpenLoop& loop, double omega_rad_s) { return bode(loop, std::vector{omega_rad_s})[0]; }

double magnitude_at(const OpenLoop& loop, double omega_rad_s) {
  return std::abs(open_loop_response(loop, omega_rad_s));
}

TEST(Figure6, IsWrittenAsTheReferenceHasIt) {
  const auto reference = golden();
  const std::vector<double> omega_rad_s = reference["w"];
  const auto points = bode(kPositionLoop, omega_rad_s);
  const auto path = figure_path("figure_6_bode.csv");
  std::ofstream csv{path};
  csv.precision(12);
  csv << "omega_rad_s,magnitude_db,phase_deg\n";
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_NEAR(points[i].magnitude_db, reference["mag_db"][i], 1e-8);
    EXPECT_NEAR(points[i].phase_deg, reference["phase_deg"][i], 1e-8);
    csv << points[i].omega_rad_s << ',' << points[i].magnitude_db << ',' << points[i].phase_deg << '\n';
  }
  csv.close();
  EXPECT_TRUE(csv) << path;
}

TEST(Figure6, At65RadPerSTheLoopIsFarBelowItsCrossover) {
  const auto at_65 = golden()["key"]["at65"];
  EXPECT_NEAR(magnitude_at(kPositionLoop, kPrintedCrossoverRadS), at_65["mag"], 1e-13);
  EXPECT_NEAR(point_at(kPositionLoop, kPrintedCrossoverRadS).phase_deg, at_65["phase_deg"], 1e-9);
  EXPECT_NEAR(open_loop_phase_slope_s(kPositionLoop, kPrintedCrossoverRadS), at_65["dphase_rad_per_radps"], 1e-14);
  const Complex s{0, kPrintedCrossoverRadS}, h = velocity_transfer(kNonNewtonianModel, s) / s;
  EXPECT_NEAR(std::abs(h), at_65["H_mag"], 1e-15);
  EXPECT_NEAR(std::abs(controller_transfer(kPaperController, s)), at_65["C_mag"], 1e-10);
}

TEST(Figure6, ThePrintedCrossoverAndMarginDoNotHold) {
  const Margins achieved = margins(kPositionLoop);
  EXPECT_NEAR(achieved.gain_crossover_rad_s.value(), 5.9995, 1e-4);
  EXPECT_NEAR(achieved.phase_margin_deg.value(), 64.998, 1e-3);
  EXPECT_NEAR(achieved.phase_slope_deg_per_rad_s.value(), -3.84, 1e-3);  // nor iso-damping
  EXPECT_GT(kPrintedCrossoverRadS / *achieved.gain_crossover_rad_s, 10);
  EXPECT_NEAR(180 + point_at(kPositionLoop, kPrintedCrossoverRadS).phase_deg, -17.48, 0.01);  // not 72
}

TEST(Figure6, WithoutTheIntegratorTheyNearlyHold) {
  const auto velocity_loop = golden()["key"]["velocity_loop"];
  EXPECT_NEAR(magnitude_at(kVelocityLoop, kPrintedCrossoverRadS), velocity_loop["mag_at65"], 1e-11);
  EXPECT_NEAR(magnitude_at(kVelocityLoop, kPrintedCrossoverRadS), 0.95587, 5e-6);
  const double margin_deg = 180 + point_at(kVelocityLoop, kPrintedCrossoverRadS).phase_deg;
  EXPECT_NEAR(margin_deg, velocity_loop["pm_at65_deg"], 1e-9);
  EXPECT_NEAR(margin_deg, kPrintedMarginDeg, 0.6);
  EXPECT_NEAR(open_loop_phase_slope_s(kVelocityLoop, kPrintedCrossoverRadS) * 57.29578, -0.264, 1e-3);  // not flat
}

TEST(Figure6, ThePhaseIsFlatOnlyAt185RadPerS) {
  EXPECT_LT(open_loop_phase_slope_s(kPositionLoop, 185.6), 0);
  EXPECT_GT(open_loop_phase_slope_s(kPositionLoop, 185.7), 0);
  EXPECT_NEAR(point_at(kPositionLoop, 185.633).phase_deg, -205.107, 1e-3);
}

}  // namespace
}  // namespace control
