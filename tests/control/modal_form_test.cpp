// The sum of exponentials is as accurate as it was asked to be, for any model.
#include "control/models/modal_form.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <stdexcept>

#include "control/responses/time_response.hpp"
#include "model_samples.hpp"

namespace control {
namespace {

using std::numbers::pi;

nlohmann::json response_of(const std::string& name) {
  return nlohmann::json::parse(std::ifstream(std::string(TEST_DATA_DIR "/") + name));
}

struct Motion {
  double velocity_m_s = 0;
  double position_m = 0;
};

Motion unit_step(const ModalForm& form, double t) {
  Motion sum;
  for (std::size_t i = 0; i < form.rate.size(); ++i) {
    const StepFactors factors = step_factors(form.rate[i], t);
    sum.velocity_m_s += 2 * (form.weight[i] * factors.integral).real();
    sum.position_m += 2 * (form.weight[i] * factors.double_integral).real();
  }
  return sum;
}

void expect_golden(const FractionalModel& model, const nlohmann::json& velocity, const nlohmann::json& position,
                   double tolerance) {
  const ModalForm form = modal_form(model, {0.01, 1e5, tolerance});
  const double relative = std::max(tolerance, 2e-12);
  for (std::size_t i = 1; i < velocity["t"].size(); ++i) {
    const double t = velocity["t"][i], v = velocity["velocity"][i], x = position["position"][i];
    const Motion motion = unit_step(form, t);
    EXPECT_NEAR(0.3 * motion.velocity_m_s, v, relative * v) << t << " s, tolerance " << tolerance;
    EXPECT_NEAR(0.3 * motion.position_m, x, relative * x) << t << " s, tolerance " << tolerance;
  }
}

// The largest error against Talbot, in units of what modal_form.hpp promises. Where the velocity passes near zero its
// envelope counts, which is never below the mean velocity so far.
double worst_error(const FractionalModel& model, const ModalRange& range) {
  std::vector<double> time_s;
  for (double t = range.shortest_s; t <= range.longest_s; t *= 2.3) time_s.push_back(t);
  const TimeResponse expected = step_response(model, 1, time_s);
  const ModalForm form = modal_form(model, range);
  double worst = 0;
  for (std::size_t i = 0; i < time_s.size(); ++i) {
    const double t = time_s[i], v = expected.velocity_m_s[i], x = expected.position_m[i];
    const double floor_m_s = 1e-15 * std::abs(model.kp / model.b3), mean_m_s = std::abs(x) / t;
    const double allowed_m_s = std::max(range.tolerance * std::max(std::abs(v), mean_m_s), floor_m_s);
    const double allowed_m = std::max(range.tolerance * std::abs(x), floor_m_s * t);
    const Motion motion = unit_step(form, t);
    worst = std::max(worst, std::abs(motion.velocity_m_s - v) / allowed_m_s);
    worst = std::max(worst, std::abs(motion.position_m - x) / allowed_m);
  }
  return worst;
}

std::string described(const FractionalModel& m) {
  std::ostringstream text;
  text << m.kp << "/(" << m.b1 << " s^" << m.alpha << " + " << m.b2 << " s^" << m.beta << " + " << m.b3 << ")";
  return text.str();
}

TEST(ModalForm, MeetsTheReferenceStepsOfModel29AtEveryTolerance) {
  const auto velocity = response_of("fo_step_velocity.json"), position = response_of("fo_step_position.json");
  for (const double tolerance : {1e-2, 1e-4, 1e-6, 1e-7, 1e-9, 1e-11, 1e-13}) {
    expect_golden(kNonNewtonianModel, velocity, position, tolerance);
  }
}

TEST(ModalForm, MeetsTheReferenceStepsOfTheIntegerModel28AtEveryTolerance) {
  const auto reference = response_of("io_step.json");
  for (const double tolerance : {1e-2, 1e-4, 1e-6, 1e-7, 1e-9, 1e-11, 1e-13}) {
    expect_golden(kNewtonianModel, reference, reference, tolerance);
  }
}

TEST(ModalForm, MeetsItsToleranceForModelsFromTheWholeRange) {
  for (const FractionalModel& model : sample_models(1, 150)) {
    for (const double tolerance : {1e-3, 1e-7}) {
      EXPECT_LE(worst_error(model, {0.01, 1e5, tolerance}), 1) << described(model) << ", tolerance " << tolerance;
    }
  }
}

TEST(ModalForm, MeetsTenDigitsForModelsFromTheWholeRange) {
  for (const FractionalModel& model : sample_models(2, 150)) {
    EXPECT_LE(worst_error(model, {0.01, 1e5, 1e-10}), 1) << described(model);
  }
}

TEST(ModalForm, MeetsItsToleranceForIntegerModelsOfAnyDamping) {
  for (const double damping : {0.001, 0.1, 0.5, 1 - 1e-9, 1.0, 1 + 1e-9, 3.0, 1000.0}) {
    const FractionalModel model{1, 0.04, 2 * damping * 0.2, 1, 2, 1};
    EXPECT_LE(worst_error(model, {0.01, 1e4, 1e-9}), 1) << "damping " << damping;
  }
}

TEST(ModalForm, MeetsItsToleranceForNearlyEqualAndVerySmallOrders) {
  const FractionalModel models[] = {{1, 1, 1, 1, 1.0005, 0.9995}, {1, 1, 1, 1, 0.5001, 0.5},   {1, 0, 1, 1, 2, 0.02},
                                    {1, 1, 1, 1, 0.011, 0.01},    {1, 1e-9, 1, 1, 2, 0.3},     {1, 0, 1, 1, 2, 1},
                                    {1, 1, 1e-9, 1, 1.5, 0.5},    {1, 3, 1e-9, 1, 1.01, 0.99}, {1, 1, 1, 1, 2, 0.001}};
  for (const FractionalModel& model : models) {
    EXPECT_LE(worst_error(model, {0.01, 1e5, 1e-8}), 1) << described(model);
  }
}

TEST(ModalForm, ServesRangesFromMicrosecondsToMonths) {
  for (const FractionalModel& model : {kNonNewtonianModel, kNewtonianModel}) {
    EXPECT_LE(worst_error(model, {1e-6, 1e-3, 1e-8}), 1);
    EXPECT_LE(worst_error(model, {1e-6, 1e7, 1e-8}), 1);
    EXPECT_LE(worst_error(model, {10, 1e7, 1e-8}), 1);
  }
}

TEST(ModalForm, HasOnlyDecayingModesAndFewOfThem) {
  for (const FractionalModel& model : sample_models(3, 200)) {
    const ModalForm form = modal_form(model, {0.01, 1e5, 1e-6});
    EXPECT_EQ(form.weight.size(), form.rate.size());
    EXPECT_LE(form.rate.size(), 1000u) << described(model);
    for (const Complex& rate : form.rate) EXPECT_LT(rate.real(), 0) << described(model);
  }
  EXPECT_LE(modal_form(kNonNewtonianModel, {0.01, 1e5, 1e-6}).rate.size(), 150u);
}

TEST(ModalForm, IsFiniteForAbsurdCoefficients) {
  for (const double b1 : {0.0, 1e-200, 1.0, 1e200}) {
    for (const double b2 : {1e-200, 1.0, 1e200}) {
      for (const double b3 : {1e-100, 1.0, 1e100}) {
        for (const double alpha : {1.01, 1.7, 2.0}) {
          const FractionalModel model{1, b1, b2, b3, alpha, 1};
          const ModalForm form = modal_form(model, {});
          EXPECT_LE(form.rate.size(), 5000u) << described(model);
          const Motion motion = unit_step(form, 1);
          EXPECT_TRUE(std::isfinite(motion.velocity_m_s)) << described(model);
          EXPECT_TRUE(std::isfinite(motion.position_m)) << described(model);
        }
      }
    }
  }
}

TEST(LogPole, IsThePoleOfTheReference) {
  const auto pole = response_of("fo_step_velocity.json")["poles_principal_sheet"][0];
  const std::optional<Complex> log_p = log_pole(kNonNewtonianModel);
  ASSERT_TRUE(log_p);
  EXPECT_NEAR(std::exp(*log_p).real(), pole[0].get<double>(), 1e-12);
  EXPECT_NEAR(std::exp(*log_p).imag(), pole[1].get<double>(), 1e-12);
}

TEST(LogPole, IsTheRootOfAQuadratic) {
  const std::optional<Complex> log_p = log_pole({1, 2, 3, 5, 2, 1});
  ASSERT_TRUE(log_p);
  EXPECT_NEAR(std::exp(*log_p).real(), -0.75, 1e-15);
  EXPECT_NEAR(std::exp(*log_p).imag(), std::sqrt(31.0) / 4, 1e-15);
}

TEST(LogPole, IsAZeroOfTheDenominatorInTheLeftHalfPlane) {
  int found = 0;
  for (const FractionalModel& model : sample_models(4, 300)) {
    const std::optional<Complex> log_p = log_pole(model);
    if (!log_p) continue;
    ++found;
    EXPECT_GT(log_p->imag(), pi / 2) << described(model);
    EXPECT_LT(log_p->imag(), pi) << described(model);
    const double size = model.b3 + model.b2 * std::exp(model.beta * log_p->real());
    EXPECT_LE(std::abs(denominator(model, *log_p)), 1e-12 * size) << described(model);
  }
  EXPECT_GT(found, 100);
}

// The change of arg D around the cut plane: from 0 on the positive axis far out, along the upper edge of the cut.
double turns_around_the_upper_half_plane(const FractionalModel& model) {
  double turned = 0;
  Complex before = denominator(model, {60, 0});
  const auto visit = [&](Complex log_s) {
    const Complex now = denominator(model, log_s);
    turned += std::arg(now / before);
    before = now;
  };
  for (int i = 1; i <= 2000; ++i) visit({60, pi * i / 2000});
  for (int i = 1; i <= 20'000; ++i) visit({60 - 0.006 * i, pi});
  return turned / (2 * pi);
}

TEST(LogPole, IsFoundExactlyWhereTheArgumentPrincipleCountsOne) {
  for (const FractionalModel& model : sample_models(5, 60)) {
    if (model.alpha == 2 && model.beta == 1) continue;  // the double or real poles of these lie on the path
    const std::optional<Complex> log_p = log_pole(model);
    if (log_p && log_p->imag() > pi - 1e-3) continue;
    EXPECT_NEAR(turns_around_the_upper_half_plane(model), log_p ? 1 : 0, 0.1) << described(model);
  }
}

TEST(LogPole, IsMissingForRealPolesAndForOrdersUpTo1) {
  EXPECT_FALSE(log_pole(kNewtonianModel));
  EXPECT_FALSE(log_pole({1, 1, 2, 1, 2, 1}));
  EXPECT_FALSE(log_pole({1, 1, 1, 1, 1, 0.5}));
  EXPECT_FALSE(log_pole({1, 0, 1, 1, 1.5, 0.5}));
}

TEST(StepFactors, AgreeOnBothSidesOfTheSeriesAndInTheLimits) {
  const StepFactors below = step_factors({-0.3, 0.39999}, 1), above = step_factors({-0.3, 0.40001}, 1);
  EXPECT_NEAR(std::abs(below.integral - above.integral), 0, 2e-5);
  EXPECT_NEAR(std::abs(below.double_integral - above.double_integral), 0, 2e-5);
  const StepFactors still = step_factors(0, 2);
  EXPECT_EQ(still.decay, 1.0);
  EXPECT_EQ(still.integral, 2.0);
  EXPECT_EQ(still.double_integral, 2.0);
  const StepFactors one = step_factors(-1, 0.5);
  EXPECT_NEAR(one.integral.real(), 1 - std::exp(-0.5), 1e-16);
  EXPECT_NEAR(one.double_integral.real(), std::exp(-0.5) - 0.5, 2e-16);
}

TEST(ModalForm, QuotesWhatItRefuses) {
  const auto message = [](const FractionalModel& model, const ModalRange& range) -> std::string {
    try {
      modal_form(model, range);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_EQ(message(kNonNewtonianModel, {0, 1, 1e-6}), "modal form: shortest_s must be positive, is 0");
  EXPECT_EQ(message(kNonNewtonianModel, {1, 0.5, 1e-6}), "modal form: longest_s must be above shortest_s, is 0.5");
  EXPECT_EQ(message(kNonNewtonianModel, {1, 2, 0}), "modal form: tolerance must lie in [1e-14, 0.1], is 0");
  EXPECT_EQ(message(kNonNewtonianModel, {1, 2, std::nan("")}),
            "modal form: tolerance must lie in [1e-14, 0.1], is nan");
  EXPECT_EQ(message({1, 1, 1, 1, 2.5, 1}, {}), "model: alpha must lie in (beta, 2], is 2.5");
}

}  // namespace
}  // namespace control
