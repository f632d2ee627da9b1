// Frequency responses and margins agree with the reference.
#include "control/responses/margins.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>
#include <stdexcept>

#include "control/responses/frequency_response.hpp"

namespace control {
namespace {

constexpr OpenLoop kPositionLoop{kNonNewtonianModel, kPaperController};
constexpr OpenLoop kVelocityLoop{kNonNewtonianModel, kPaperController, true};
constexpr OpenLoop kNewtonianLoop{kNewtonianModel, kPaperController};

nlohmann::json golden(const char* name) {
  return nlohmann::json::parse(std::ifstream(std::string(TEST_DATA_DIR "/") + name));
}

// A plant of integer order with a plain gain: s² + a s + b, kp = 1.
OpenLoop integer_loop(double a, double b, double gain, bool is_velocity_loop) {
  return {{1, 1, a, b, 2, 1}, {gain, 0, 1}, is_velocity_loop};
}

class RandomLoops {
 public:
  OpenLoop next() {
    const double beta = between(0.2, 1), alpha = between(beta + 0.1, 2), scale_s = std::exp(between(-8, 9));
    OpenLoop loop;
    loop.plant = {1,
                  std::exp(between(-4, 4)) * std::pow(scale_s, alpha),
                  std::exp(between(-4, 4)) * std::pow(scale_s, beta),
                  1,
                  alpha,
                  beta};
    loop.controller = {std::exp(between(-3, 6)), 0, between(0.1, 1.9)};
    loop.controller.kd = std::exp(between(-5, 5)) * std::pow(scale_s, loop.controller.mu);
    loop.is_velocity_loop = between(0, 1) < 0.5;
    if (!loop.is_velocity_loop) loop.plant.kp /= scale_s;
    return loop;
  }

  double between(double low, double high) { return std::uniform_real_distribution{low, high}(generator_); }

 private:
  std::mt19937 generator_{20210601};
};

TEST(Bode, AgreesWithTheReferenceWithin1e8) {
  const auto reference = golden("bode_open_loop.json");
  const std::vector<double> omega_rad_s = reference["w"];
  const auto points = bode(kPositionLoop, omega_rad_s), velocity = bode(kVelocityLoop, omega_rad_s);
  ASSERT_EQ(points.size(), 200u);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double magnitude_db = reference["mag_db"][i], phase_deg = reference["phase_deg"][i];
    EXPECT_NEAR(points[i].magnitude_db, magnitude_db, 1e-8);
    EXPECT_NEAR(points[i].phase_deg, phase_deg, 1e-8);
    EXPECT_NEAR(velocity[i].magnitude_db, magnitude_db + 20 * std::log10(omega_rad_s[i]), 1e-8);
    EXPECT_NEAR(velocity[i].phase_deg, phase_deg + 90, 1e-8);
  }
}

TEST(Bode, AgreesWithTheTransferFunctions) {
  RandomLoops loops;
  for (int i = 0; i < 300; ++i) {
    const OpenLoop loop = loops.next();
    const double omega_rad_s = std::exp(loops.between(-10, 10));
    const Complex s{0, omega_rad_s};
    const Complex expected =
        controller_transfer(loop.controller, s) * velocity_transfer(loop.plant, s) / (loop.is_velocity_loop ? 1.0 : s);
    const Complex response = open_loop_response(loop, omega_rad_s);
    EXPECT_LT(std::abs(response - expected), 1e-12 * std::abs(expected));
    const BodePoint point = bode(loop, std::vector{omega_rad_s})[0];
    EXPECT_NEAR(point.magnitude_db, 20 * std::log10(std::abs(expected)), 1e-10);
    EXPECT_NEAR(std::abs(std::polar(1.0, point.phase_deg / kDegPerRad) - expected / std::abs(expected)), 0, 1e-12);
    EXPECT_NEAR(open_loop_phase_rad(loop, omega_rad_s) * kDegPerRad, point.phase_deg, 1e-10);
  }
}

TEST(Bode, PhaseIsContinuousAndItsSlopeIsItsDerivative) {
  RandomLoops loops;
  for (int i = 0; i < 100; ++i) {
    const OpenLoop loop = loops.next();
    const auto points = bode(loop, log_spaced(1e-9, 1e9, 4000));
    for (std::size_t k = 1; k < points.size(); ++k) {
      EXPECT_LT(std::abs(points[k].phase_deg - points[k - 1].phase_deg), 20);
    }
    const double omega_rad_s = std::exp(loops.between(-10, 10)), h = 1e-5 * omega_rad_s;
    const double difference =
        (open_loop_phase_rad(loop, omega_rad_s + h) - open_loop_phase_rad(loop, omega_rad_s - h)) / (2 * h);
    EXPECT_NEAR(open_loop_phase_slope_s(loop, omega_rad_s) * omega_rad_s, difference * omega_rad_s, 1e-7);
  }
}

TEST(Bode, RefusesFrequenciesThatAreNotPositive) {
  const std::vector<double> with_zero{1, 0}, with_nan{std::numeric_limits<double>::quiet_NaN()};
  EXPECT_THROW(bode(kPositionLoop, with_zero), std::invalid_argument);
  EXPECT_THROW(bode(kPositionLoop, with_nan), std::invalid_argument);
  EXPECT_THROW(open_loop_response(kPositionLoop, -1), std::invalid_argument);
}

TEST(LogSpaced, HasItsEndsExactAndEqualRatios) {
  const auto frequencies = log_spaced(0.01, 1000, 6);
  EXPECT_EQ(frequencies.front(), 0.01);
  EXPECT_EQ(frequencies.back(), 1000);
  for (std::size_t i = 1; i < 6; ++i) EXPECT_NEAR(frequencies[i] / frequencies[i - 1], 10, 1e-12);
  EXPECT_THROW(log_spaced(1, 1, 5), std::invalid_argument);
  EXPECT_THROW(log_spaced(1, 10, 1), std::invalid_argument);
  EXPECT_THROW(log_spaced(0, 10, 5), std::invalid_argument);
}

TEST(Margins, OfThePapersLoopsAreTheReference) {
  const auto key = golden("bode_open_loop.json")["key"];
  const Margins position = margins(kPositionLoop);
  EXPECT_NEAR(position.gain_crossover_rad_s.value(), key["position_loop"]["w_gc"], 1e-11);
  EXPECT_NEAR(position.phase_margin_deg.value(), key["position_loop"]["pm_deg"], 1e-10);
  EXPECT_NEAR(position.phase_slope_deg_per_rad_s.value(), key["position_loop"]["dphase_deg_per_radps"], 1e-11);
  EXPECT_NEAR(position.ms, 1.3350, 5e-5);
  EXPECT_NEAR(position.mt, 1.0008, 5e-5);
  EXPECT_TRUE(position.is_closed_loop_stable);

  const Margins velocity = margins(kVelocityLoop);
  EXPECT_NEAR(velocity.gain_crossover_rad_s.value(), key["velocity_loop"]["w_gc"], 1e-9);
  EXPECT_NEAR(velocity.phase_margin_deg.value(), key["velocity_loop"]["pm_deg"], 1e-10);

  const Margins newtonian = margins(kNewtonianLoop);
  EXPECT_NEAR(newtonian.gain_crossover_rad_s.value(), key["newtonian_position_loop"]["w_gc"], 1e-10);
  EXPECT_NEAR(newtonian.phase_margin_deg.value(), key["newtonian_position_loop"]["pm_deg"], 1e-10);
  EXPECT_NEAR(newtonian.ms, 2.281, 5e-4);
}

// The reference took Mt from a grid: it misses the last 2e-7 of the sharpest peaks, and the limit of 1 at 0 rad/s.
TEST(Margins, PeaksOfTheTunedLoopsAreTheReference) {
  const auto reference = golden("tuning_solutions.json");
  for (const char* list : {"exact_isodamped", "relaxed_no_isodamping"}) {
    for (const auto& row : reference[list]) {
      SCOPED_TRACE(row.dump());
      const FopdController controller{row["kp"], row["kd"], row["mu"]};
      const Margins result = margins({kNonNewtonianModel, controller});
      EXPECT_NEAR(result.ms / row["Ms"].get<double>(), 1, 1e-7);
      const double mt = row["Mt"];
      EXPECT_NEAR(result.mt / mt, 1, 1e-6);
      EXPECT_GE(result.mt, mt * (1 - 1e-9));
      if (!row.contains("dphase_deg_per_radps")) continue;
      EXPECT_NEAR(result.phase_slope_deg_per_rad_s.value(), row["dphase_deg_per_radps"], 1e-6);
    }
  }
}

TEST(Margins, FindsBothSidesOfAResonanceSharperThanTheScan) {
  const double damping = 1e-7, gain = 0.5;
  const Margins result = margins(integer_loop(damping, 1, gain, true));
  // |(1 - ω²) + j a ω| = gain
  const double middle = 1 - damping * damping / 2, spread = std::sqrt(middle * middle - (1 - gain * gain));
  ASSERT_EQ(result.gain_crossovers_rad_s.size(), 2u);
  EXPECT_NEAR(result.gain_crossovers_rad_s[0] / std::sqrt(middle - spread), 1, 1e-12);
  EXPECT_NEAR(result.gain_crossovers_rad_s[1] / std::sqrt(middle + spread), 1, 1e-12);
  EXPECT_EQ(result.gain_crossover_rad_s, result.gain_crossovers_rad_s[1]);  // the smaller phase margin
  EXPECT_NEAR(result.ms_at_rad_s, std::sqrt(1 + gain), 1e-6);               // where the closed loop resonates
}

TEST(Margins, GainMarginOfAnIntegerLoopIsThatOfRouth) {
  const double a = 3, b = 4, gain = 5;
  const Margins result = margins(integer_loop(a, b, gain, false));
  ASSERT_EQ(result.phase_crossovers_rad_s.size(), 1u);
  EXPECT_NEAR(result.phase_crossovers_rad_s[0], std::sqrt(b), 1e-12);
  EXPECT_NEAR(result.gain_margin_db.value(), 20 * std::log10(a * b / gain), 1e-11);
  EXPECT_TRUE(result.is_closed_loop_stable);
  EXPECT_FALSE(margins(integer_loop(a, b, 1.001 * a * b, false)).is_closed_loop_stable);
  EXPECT_LT(margins(integer_loop(a, b, 1.001 * a * b, false)).gain_margin_db.value(), 0);
}

// s (s² + a s + b) + k (1 + kd s) has its zeros on the left exactly if a (b + k kd) > k.
TEST(Margins, ClosedLoopIsStableExactlyWhereRouthSaysSo) {
  RandomLoops random;
  int stable = 0;
  for (int i = 0; i < 300; ++i) {
    const double a = std::exp(random.between(-3, 3)), b = std::exp(random.between(-3, 3));
    const double k = std::exp(random.between(-3, 5)), kd = std::exp(random.between(-5, 1));
    const Margins result = margins({{1, 1, a, b, 2, 1}, {k, kd, 1}, false});
    EXPECT_EQ(result.is_closed_loop_stable, a * (b + k * kd) > k) << a << ' ' << b << ' ' << k << ' ' << kd;
    stable += result.is_closed_loop_stable;
  }
  EXPECT_GT(stable, 50);
  EXPECT_LT(stable, 250);
}

TEST(Margins, NegativePlantGainIsUnstableInPositionAndAboveOneInVelocity) {
  OpenLoop loop = integer_loop(3, 4, 5, false);
  loop.plant.kp = -1;
  EXPECT_FALSE(margins(loop).is_closed_loop_stable);
  loop.is_velocity_loop = true;  // DC gain 5/4
  EXPECT_FALSE(margins(loop).is_closed_loop_stable);
  loop.controller.kp = 3;
  EXPECT_TRUE(margins(loop).is_closed_loop_stable);
}

TEST(Margins, ALoopThatNeverReachesOneHasNoCrossover) {
  const Margins result = margins(integer_loop(3, 4, 1, true));
  EXPECT_TRUE(result.gain_crossovers_rad_s.empty());
  EXPECT_FALSE(result.gain_crossover_rad_s || result.phase_margin_deg || result.phase_slope_deg_per_rad_s);
  EXPECT_FALSE(result.gain_margin_db);
  EXPECT_TRUE(result.is_closed_loop_stable);
  EXPECT_NEAR(result.mt, 1 / std::hypot(4.5, 3 * std::sqrt(0.5)), 1e-12);  // T = 1/(s² + 3 s + 5), at ω² = 1/2
}

TEST(Margins, DoNotDependOnTheUnitOfTime) {
  for (const double scale_s : {1e-6, 1e-3, 3600.0, 1e8}) {
    const auto& [kp, b1, b2, b3, alpha, beta, dead_time_s] = kNonNewtonianModel;
    OpenLoop loop = kPositionLoop;
    loop.plant = {kp / scale_s, b1 * std::pow(scale_s, alpha), b2 * std::pow(scale_s, beta), b3, alpha, beta};
    loop.controller.kd *= std::pow(scale_s, loop.controller.mu);
    const Margins result = margins(loop), reference = margins(kPositionLoop);
    EXPECT_NEAR(*result.gain_crossover_rad_s * scale_s / *reference.gain_crossover_rad_s, 1, 1e-12);
    EXPECT_NEAR(*result.phase_margin_deg, *reference.phase_margin_deg, 1e-10);
    EXPECT_NEAR(result.ms, reference.ms, 1e-10);
    EXPECT_NEAR(result.mt, reference.mt, 1e-10);
    EXPECT_NEAR(*result.gain_margin_db, *reference.gain_margin_db, 1e-9);
  }
}

TEST(Margins, AgreeWithABruteForceScan) {
  RandomLoops loops;
  for (int i = 0; i < 150; ++i) {
    const OpenLoop loop = loops.next();
    const Margins result = margins(loop);
    std::size_t crossovers = 0;
    double ms = 0, mt = 0, previous = 0;
    for (const double omega_rad_s : log_spaced(1e-12, 1e12, 6000)) {
      const Complex l = open_loop_response(loop, omega_rad_s);
      const double above = std::log(std::abs(l));
      crossovers += above * previous < 0;
      previous = above;
      ms = std::max(ms, 1 / std::abs(1.0 + l));
      mt = std::max(mt, std::abs(l / (1.0 + l)));
    }
    SCOPED_TRACE(i);
    EXPECT_GE(result.gain_crossovers_rad_s.size(), crossovers);
    EXPECT_LE(result.gain_crossovers_rad_s.size(), crossovers + 2);
    EXPECT_GE(result.ms, ms * (1 - 1e-9));
    EXPECT_GE(result.mt, mt * (1 - 1e-9));
    if (ms < 3) EXPECT_LT(result.ms, std::max(ms, 1.0) * 1.001);  // 1: a limit that the scan may not have reached
    if (mt < 3) EXPECT_LT(result.mt, std::max(mt, 1.0) * 1.001);
    EXPECT_TRUE(std::ranges::is_sorted(result.gain_crossovers_rad_s));
    for (const double omega_rad_s : result.gain_crossovers_rad_s) {
      EXPECT_NEAR(std::abs(open_loop_response(loop, omega_rad_s)), 1, 1e-12);
    }
    for (const double omega_rad_s : result.phase_crossovers_rad_s) {
      EXPECT_NEAR(open_loop_phase_rad(loop, omega_rad_s), -std::numbers::pi, 1e-12);
    }
  }
}

TEST(Margins, AreFiniteFarFromAnyReasonableScale) {
  for (const double mu : {0.01, 1.99}) {
    for (const double beta : {0.01, 1.0}) {
      const OpenLoop loop{{1e-6, 1e12, 1e-12, 1, 2, beta}, {1e6, 1e-9, mu}, false};
      const Margins result = margins(loop);
      EXPECT_TRUE(std::isfinite(result.ms) && std::isfinite(result.mt)) << mu << ' ' << beta;
    }
  }
}

TEST(Margins, RefuseABadLoop) {
  OpenLoop loop = kPositionLoop;
  loop.controller.mu = 2;
  EXPECT_THROW(margins(loop), std::invalid_argument);
  loop = kPositionLoop;
  loop.plant.b2 = 0;
  EXPECT_THROW(margins(loop), std::invalid_argument);
}

}  // namespace
}  // namespace control
