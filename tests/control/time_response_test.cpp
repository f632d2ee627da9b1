// Responses in time agree with the reference, with series and with each other.
#include "control/responses/time_response.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "model_samples.hpp"

namespace control {
namespace {

constexpr double kDuty = 0.3;
constexpr double kDayS = 86'400;

nlohmann::json golden(const std::string& name) {
  return nlohmann::json::parse(std::ifstream(std::string(TEST_DATA_DIR "/") + name));
}

std::string described(const FractionalModel& m) {
  std::ostringstream text;
  text << m.kp << "/(" << m.b1 << " s^" << m.alpha << " + " << m.b2 << " s^" << m.beta << " + " << m.b3 << ")";
  return text.str();
}

void expect_step(const FractionalModel& model, const nlohmann::json& velocity, const nlohmann::json& position) {
  const std::vector<double> time_s = velocity["t"];
  const TimeResponse response = step_response(model, kDuty, time_s);
  EXPECT_EQ(response.velocity_m_s[0], 0);
  EXPECT_EQ(response.position_m[0], 0);
  for (std::size_t i = 1; i < time_s.size(); ++i) {
    const double v = velocity["velocity"][i], x = position["position"][i];
    EXPECT_NEAR(response.velocity_m_s[i], v, 1e-11 * v) << time_s[i] << " s";
    EXPECT_NEAR(response.position_m[i], x, 1e-11 * x) << time_s[i] << " s";
  }
}

// E_{a,b}(z) = Σ z^k/Γ(a k + b), for arguments where the terms stay small enough for the digits of a long double.
double mittag_leffler(double a, double b, double z) {
  long double sum = 0, power = 1;
  for (int k = 0; k < 400; ++k, power *= z) {
    const long double place = static_cast<long double>(a) * k + b;
    if (place > 1500) break;
    sum += power / std::tgamma(place);
  }
  return static_cast<double>(sum);
}

bool series_is_exact(double a, double z) { return std::pow(std::abs(z), 1 / a) < 10; }

struct Motion {
  double velocity_m_s = 0;
  double position_m = 0;
};

// The step of duty 1 as a double power series: 1/D in powers of s^-1, the geometric series in b3 and the binomial
// series in b2, term by term into the time domain.
Motion power_series_step(const FractionalModel& m, double t) {
  long double velocity = 0, position = 0;
  const long double log_t = std::log(static_cast<long double>(t));
  for (int n = 0; n < 120; ++n) {
    for (int k = 0; k < 200; ++k) {
      const long double order = m.alpha * (n + 1.0L) + (static_cast<long double>(m.alpha) - m.beta) * k;
      const long double log_term = n * std::log(static_cast<long double>(m.b3)) +
                                   k * std::log(static_cast<long double>(m.b2)) -
                                   (n + k + 1) * std::log(static_cast<long double>(m.b1)) + order * log_t +
                                   std::lgamma(n + k + 1.0L) - std::lgamma(n + 1.0L) - std::lgamma(k + 1.0L);
      const long double sign = (n + k) % 2 == 0 ? 1 : -1;
      velocity += sign * std::exp(log_term - std::lgamma(order + 1));
      position += sign * std::exp(log_term + log_t - std::lgamma(order + 2));
    }
  }
  return {m.kp * static_cast<double>(velocity), m.kp * static_cast<double>(position)};
}

TEST(MittagLeffler, SeriesMeetsTheReferenceWhereItConverges) {
  int compared = 0;
  for (const auto& row : golden("mittag_leffler.json")["values"]) {
    const double a = row[0], b = row[1], z = row[2], expected = row[3];
    if (!series_is_exact(a, z)) continue;
    ++compared;
    EXPECT_NEAR(mittag_leffler(a, b, z), expected, 1e-12 * std::max(std::abs(expected), 0.01)) << row;
  }
  EXPECT_GE(compared, 80);
}

// v = (kp/b3)(1 - E_{β,1}(z)) and x = (kp/b3) t (1 - E_{β,2}(z)), z = -(b3/b2) t^β, for b1 = 0.
TEST(StepResponse, OfASingleTermModelIsAMittagLefflerFunctionOfTheReference) {
  for (const auto& row : golden("mittag_leffler.json")["values"]) {
    const double beta = row[0], b = row[1], z = row[2], expected = row[3];
    if (beta > 1 || z >= 0 || (b != 1 && b != 2)) continue;
    const FractionalModel model{2, 0, 0.5, 4, 2, beta};
    const double t[] = {std::pow(-z * model.b2 / model.b3, 1 / beta)}, gain = model.kp / model.b3;
    const TimeResponse response = step_response(model, 1, t);
    const double found = b == 1 ? response.velocity_m_s[0] : response.position_m[0] / t[0];
    EXPECT_NEAR(found, gain * (1 - expected), 1e-11 * found) << row;
  }
}

TEST(StepResponse, OfASingleTermModelMeetsTheMittagLefflerSeriesFromItsFirstMillisecond) {
  for (const double beta : {0.2, 0.4, 0.6, 0.8682, 0.98, 1.0}) {
    const FractionalModel model{0.1, 0, 0.11031, 1, 2, beta};
    for (double t = 1e-3; series_is_exact(beta, t / 0.11031) && t < 0.3; t *= 1.4) {
      const double z = -std::pow(t, beta) / model.b2, times_s[] = {t};
      const TimeResponse response = step_response(model, 1, times_s);
      const double v = model.kp * -z * mittag_leffler(beta, 1 + beta, z);  // 1 - E_{β,1}(z) without cancellation
      const double x = model.kp * -z * t * mittag_leffler(beta, 2 + beta, z);
      if (!series_is_exact(beta, z)) break;
      EXPECT_NEAR(response.velocity_m_s[0], v, 1e-11 * v) << beta << ", " << t << " s";
      EXPECT_NEAR(response.position_m[0], x, 1e-11 * x) << beta << ", " << t << " s";
    }
  }
}

TEST(StepResponse, OfModel29MeetsItsPowerSeriesDownToAMicrosecond) {
  for (const double t : {1e-6, 1e-5, 1e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.2}) {
    const double times_s[] = {t};
    const TimeResponse response = step_response(kNonNewtonianModel, 1, times_s);
    const Motion series = power_series_step(kNonNewtonianModel, t);
    EXPECT_NEAR(response.velocity_m_s[0], series.velocity_m_s, 1e-11 * series.velocity_m_s) << t << " s";
    EXPECT_NEAR(response.position_m[0], series.position_m, 1e-11 * series.position_m) << t << " s";
  }
}

TEST(StepResponse, OfModel29MeetsTheReference) {
  expect_step(kNonNewtonianModel, golden("fo_step_velocity.json"), golden("fo_step_position.json"));
}

TEST(StepResponse, OfTheIntegerModel28MeetsTheReference) {
  expect_step(kNewtonianModel, golden("io_step.json"), golden("io_step.json"));
}

// (29) creeps: v = kp (1 - b2 t^-β/Γ(1-β) + b2² t^-2β/Γ(1-2β) - b1 t^-α/Γ(1-α) ...), all within 1e-12 after a day.
TEST(StepResponse, OfModel29MeetsItsAsymptoticSeriesAfterADay) {
  const FractionalModel& m = kNonNewtonianModel;
  const double t = kDayS, times_s[] = {t};
  double series = 1 - m.b1 * std::pow(t, -m.alpha) / std::tgamma(1 - m.alpha);
  for (int n = 1; n < 4; ++n) series += std::pow(-m.b2 * std::pow(t, -m.beta), n) / std::tgamma(1 - n * m.beta);
  EXPECT_NEAR(step_response(m, 1, times_s).velocity_m_s[0], m.kp * series, 1e-12 * m.kp);
}

// v = g (1 - e^{at} (cos ωt - (a/ω) sin ωt)); x is its integral.
TEST(StepResponse, OfLightlyDampedIntegerModelsMeetsTheirClosedForm) {
  for (const double damping : {1e-4, 1e-2, 0.3, 0.9}) {
    const FractionalModel model{2, 0.25, damping, 1, 2, 1};  // natural rate 2 rad/s
    const double a = -2 * damping, w = 2 * std::sqrt(1 - damping * damping);
    for (double t = 1e-2; t < kDayS; t *= 1.7) {
      const double times_s[] = {t}, decay = std::exp(a * t), cosine = std::cos(w * t), sine = std::sin(w * t);
      const TimeResponse response = step_response(model, 1, times_s);
      EXPECT_NEAR(response.velocity_m_s[0], 2 * (1 - decay * (cosine - a / w * sine)), 2e-12) << damping << " " << t;
      const double square = a * a + w * w, integral_of_cosine = (decay * (a * cosine + w * sine) - a) / square;
      const double integral_of_sine = (decay * (a * sine - w * cosine) + w) / square;
      const double x = 2 * (t - integral_of_cosine + a / w * integral_of_sine);
      EXPECT_NEAR(response.position_m[0], x, 2e-12 * std::max(t, 1.0)) << damping << " " << t;
    }
  }
}

TEST(StepResponse, IsFiniteAndHasItsFinalVelocityForModelsFromTheWholeRange) {
  std::vector<double> time_s{0};
  for (double t = 1e-9; t < 1e12; t *= 10) time_s.push_back(t);
  for (const FractionalModel& model : sample_models(11, 200)) {
    const TimeResponse response = step_response(model, 1, time_s);
    for (const double v : response.velocity_m_s) EXPECT_TRUE(std::isfinite(v)) << described(model);
    for (const double x : response.position_m) EXPECT_TRUE(std::isfinite(x)) << described(model);
    const double creep = model.b2 / model.b3 * std::pow(time_s.back(), -model.beta) +
                         model.b1 / model.b3 * std::pow(time_s.back(), -model.alpha);
    const double final_m_s = model.kp / model.b3;
    EXPECT_NEAR(response.velocity_m_s.back() / final_m_s, 1, 2 * creep + 1e-10) << described(model);
  }
}

TEST(SampledResponse, OfAStepIsTheStepResponse) {
  for (const FractionalModel& model : {kNonNewtonianModel, kNewtonianModel}) {
    std::vector<double> time_s;
    for (int k = 0; k <= 1000; ++k) time_s.push_back(0.02 * k);
    const std::vector<double> duty(time_s.size(), kDuty);
    const TimeResponse sampled = sampled_response(model, time_s, duty), step = step_response(model, kDuty, time_s);
    for (std::size_t k = 0; k < time_s.size(); ++k) {
      EXPECT_NEAR(sampled.velocity_m_s[k], step.velocity_m_s[k], 1e-11 * step.velocity_m_s[k]) << time_s[k];
      EXPECT_NEAR(sampled.position_m[k], step.position_m[k], 1e-11 * step.position_m[k]) << time_s[k];
    }
  }
}

// Σ of step responses to each change of the duty.
void expect_superposition(const FractionalModel& model, const std::vector<double>& time_s,
                          const std::vector<double>& duty) {
  std::vector<double> velocity_m_s(time_s.size()), position_m(time_s.size());
  double fastest_m_s = 0, farthest_m = 0;
  for (std::size_t j = 0; j < time_s.size(); ++j) {
    std::vector<double> since_s;
    for (std::size_t k = j; k < time_s.size(); ++k) since_s.push_back(time_s[k] - time_s[j]);
    const TimeResponse step = step_response(model, j == 0 ? duty[0] : duty[j] - duty[j - 1], since_s);
    for (std::size_t k = j; k < time_s.size(); ++k) {
      velocity_m_s[k] += step.velocity_m_s[k - j], position_m[k] += step.position_m[k - j];
      fastest_m_s = std::max(fastest_m_s, std::abs(velocity_m_s[k]));
      farthest_m = std::max(farthest_m, std::abs(position_m[k]));
    }
  }
  const TimeResponse response = sampled_response(model, time_s, duty);
  for (std::size_t k = 0; k < time_s.size(); ++k) {
    EXPECT_NEAR(response.velocity_m_s[k], velocity_m_s[k], 1e-10 * fastest_m_s) << described(model) << time_s[k];
    EXPECT_NEAR(response.position_m[k], position_m[k], 1e-10 * farthest_m) << described(model) << time_s[k];
  }
}

TEST(SampledResponse, IsTheSumOfStepResponsesForVaryingIntervals) {
  std::vector<double> time_s{5}, duty;
  for (int k = 0; k < 60; ++k) time_s.push_back(time_s.back() + (k % 3 == 0 ? 0.5 : 0.003 * (k % 7 + 1)));
  for (std::size_t k = 0; k < time_s.size(); ++k) duty.push_back(std::sin(0.9 * static_cast<double>(k)));
  expect_superposition(kNonNewtonianModel, time_s, duty);
  expect_superposition(kNewtonianModel, time_s, duty);
  for (const FractionalModel& model : sample_models(12, 20)) expect_superposition(model, time_s, duty);
}

TEST(SampledResponse, IsTheSumOfStepResponsesFromMillisecondsToADay) {
  std::vector<double> time_s{0}, duty{1};
  for (double t = 1e-3; t < kDayS; t *= 1.5) time_s.push_back(t), duty.push_back(-0.8 * duty.back());
  expect_superposition(kNonNewtonianModel, time_s, duty);
  expect_superposition(kNewtonianModel, time_s, duty);
}

TEST(SampledResponse, StartsAtRestAndDoesNotSeeTheLastDuty) {
  const double once[] = {7.0}, any[] = {0.5};
  EXPECT_EQ(sampled_response(kNonNewtonianModel, once, any).velocity_m_s, std::vector<double>{0});
  const double time_s[] = {0, 1, 2}, first[] = {1, 0, 0}, second[] = {1, 0, 9};
  EXPECT_EQ(sampled_response(kNonNewtonianModel, time_s, first).position_m,
            sampled_response(kNonNewtonianModel, time_s, second).position_m);
}

std::string refusal(auto call) {
  try {
    call();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "accepted";
}

TEST(TimeResponse, QuotesTheTimesAndDutiesItRefuses) {
  const auto step = [](std::vector<double> time_s, double duty = 1) {
    return refusal([&] { step_response(kNonNewtonianModel, duty, time_s); });
  };
  EXPECT_EQ(step({1, -0.5}), "time response: times must be finite and not negative, is -0.5");
  EXPECT_EQ(step({std::nan("")}), "time response: times must be finite and not negative, is nan");
  EXPECT_EQ(step({1}, INFINITY), "time response: duty must be finite, is inf");
  EXPECT_EQ(step({}), "accepted");

  const auto sampled = [](std::vector<double> time_s, std::vector<double> duty) {
    return refusal([&] { sampled_response(kNonNewtonianModel, time_s, duty); });
  };
  EXPECT_EQ(sampled({}, {}), "time response: time_s must have at least one value, has 0");
  EXPECT_EQ(sampled({0, 1}, {1}), "time response: duty must have as many values as time_s, the difference is -1");
  EXPECT_EQ(sampled({0, 1, 1}, {1, 1, 1}), "time response: time_s must ascend strictly, does not at 1");
  EXPECT_EQ(sampled({0, INFINITY}, {1, 1}), "time response: time_s must be finite, is inf");
  EXPECT_EQ(sampled({0, 1}, {1, std::nan("")}), "time response: duty must be finite, is nan");
}

TEST(TimeResponse, RefusesModelsThatAreNotAllowed) {
  const double time_s[] = {0, 1}, duty[] = {1, 1};
  FractionalModel model;
  model.b3 = -1;
  EXPECT_EQ(refusal([&] { step_response(model, 1, time_s); }), "model: b3 must be positive, is -1");
  EXPECT_EQ(refusal([&] { sampled_response(model, time_s, duty); }), "model: b3 must be positive, is -1");
}

}  // namespace
}  // namespace control
