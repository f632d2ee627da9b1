// The search for the sections of an estimator's model.
#include "control/discretisation/estimator_model.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <numbers>
#include <span>
#include <vector>

#include "base/invalid_argument.hpp"
#include "control/responses/time_response.hpp"

namespace control {
namespace {

constexpr int kLastTick = 6000;              // 60 s
constexpr double kLateTick = 1e30;           // stands for the final velocity,
constexpr double kLateWeight = 0.5;          // which may be off by twice as much
constexpr double kFitRatio = 1.06;           // of the next time that is fitted to the last
constexpr double kCompareRatio = 1.01;       // of the next time that is compared, at a tick or between ticks
constexpr double kNearLargest = 0.9;         // of the largest error between ticks: a peak that may exceed it
constexpr int kPeakSteps = 24;               // of the golden section: 1e-5 of the distance of two times
constexpr double kLargestGain = 10;          // |g_i|
constexpr double kLargestParameterM_S = 10;  // of a gain, on the robot
constexpr double kShortestS = 0.005;         // τ_i; (2) is far from an exponential below it
constexpr double kLongestS = 1000;           // τ_i, on the robot
constexpr double kGoodEnough = 0.0002;       // with this fit error no further section is added
constexpr double kOvershoots = 0.005;        // in words
constexpr int kIterations = 100;             // for one p
constexpr int kRefined = 3;                  // of the starts, the best are refined for p > 2
constexpr double kRidge = 1e-9;              // of the gains at a start
constexpr double kLargestStep = 0.5;         // of ln τ_i
constexpr double kLeastImprovement = 1e-6;   // relative; less of it ends the search

// By multiples of the time to 63 % of the final velocity; the first `sections` of a row serve.
constexpr std::array<std::array<double, kEstimatorSections>, 8> kStarts{{{1, 0.3, 6, 60},
                                                                         {0.4, 1.2, 0.15, 30},
                                                                         {0.3, 0.4, 0.25, 5},
                                                                         {0.6, 0.5, 0.7, 0.8},
                                                                         {0.15, 2, 0.1, 10},
                                                                         {0.25, 0.2, 0.3, 0.35},
                                                                         {0.5, 0.3, 3, 30},
                                                                         {1.2, 1, 1.5, 8}}};

constexpr int kMost = 2 * static_cast<int>(kEstimatorSections);
using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMost, kMost>;
using Column = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMost, 1>;

// The step response, relative to the final velocity.
struct Target {
  std::vector<double> tick, velocity;
  double weight(std::size_t n) const { return tick[n] > kLastTick ? kLateWeight : 1; }
};

std::vector<double> ticks(double ratio) {
  std::vector<double> chosen;
  for (double tick = 1; tick < kLastTick; tick = std::max(tick + 1, std::floor(tick * ratio))) chosen.push_back(tick);
  chosen.push_back(kLastTick);
  return chosen;
}

Target target_of(const FractionalModel& plant, double ratio) {
  Target target{ticks(ratio), {}};
  std::vector<double> time_s = target.tick;
  for (double& time : time_s) time *= kEstimatorPeriodS;
  target.velocity = step_response(plant, plant.b3 / plant.kp, time_s).velocity_m_s;
  return target;
}

template <class T>
T decayed_share(T x) {
  return 12 * x / (12 + 6 * x + x * x);
}

// ln(1 - σ) of a section.
double log_decay(double log_tau) { return std::log1p(-decayed_share(kEstimatorPeriodS * std::exp(-log_tau))); }

// What is searched: ln τ_i first, g_i behind.
struct Candidate {
  Column values;
  double largest = std::numeric_limits<double>::infinity();  // residual

  int sections() const { return static_cast<int>(values.size()) / 2; }
};

class Search {
 public:
  Search(const Target& target, double largest_gain) : target_(target), largest_gain_(largest_gain) {
    const std::size_t points = target.tick.size();
    residual_.resize(points);
    slopes_.resize(points * kMost);
  }

  Candidate best(int sections, double time_scale_s);

 private:
  Candidate start(int sections, std::size_t row, double time_scale_s);
  void refine(Candidate& candidate, double power);
  void evaluate(const Column& values, bool with_slopes);
  double cost(double power, double scale) const;
  void normal_equations(double power, double scale, int unknowns);
  Column bounded(Column values, const Column& step) const;

  const Target& target_;
  double largest_gain_;
  std::vector<double> residual_;
  std::vector<double> slopes_;  // kMost of each point
  Square normal_;
  Column descent_;
};

// Residuals of (3) and their slopes.
void Search::evaluate(const Column& values, bool with_slopes) {
  const int sections = static_cast<int>(values.size()) / 2;
  const std::size_t points = target_.tick.size();
  for (std::size_t n = 0; n < points; ++n) residual_[n] = -target_.weight(n) * target_.velocity[n];
  for (int i = 0; i < sections; ++i) {
    constexpr double kSmall = 1e-5;
    const double rate = log_decay(values[i]), gain = values[sections + i];
    const double rate_slope = (log_decay(values[i] + kSmall) - log_decay(values[i] - kSmall)) / (2 * kSmall);
    double* slope = slopes_.data();
    for (std::size_t n = 0; n < points; ++n, slope += kMost) {
      const double weight = target_.weight(n), left = std::exp(rate * target_.tick[n]);
      residual_[n] += weight * gain * (1 - left);
      if (!with_slopes) continue;
      slope[i] = -weight * gain * left * target_.tick[n] * rate_slope;
      slope[sections + i] = weight * (1 - left);
    }
  }
}

double Search::cost(double power, double scale) const {
  double sum = 0;
  for (const double residual : residual_) sum += std::pow(std::abs(residual) / scale, power);
  return sum;
}

// Of (3), by Gauss and Newton, divided by p · scale^(p - 2).
void Search::normal_equations(double power, double scale, int unknowns) {
  normal_.setZero(unknowns, unknowns);
  descent_.setZero(unknowns);
  double* normal = normal_.data();
  double* descent = descent_.data();
  const double* slope = slopes_.data();
  for (const double residual : residual_) {
    const double weight = std::pow(std::abs(residual) / scale, power - 2);
    for (int i = 0; i < unknowns; ++i) {
      descent[i] -= weight * residual * slope[i];
      const double weighted = (power - 1) * weight * slope[i];
      for (int j = 0; j <= i; ++j) normal[i * unknowns + j] += weighted * slope[j];
    }
    slope += kMost;
  }
  for (int i = 0; i < unknowns; ++i) {
    for (int j = 0; j < i; ++j) normal[j * unknowns + i] = normal[i * unknowns + j];
  }
}

Column Search::bounded(Column values, const Column& step) const {
  static const double kLow = std::log(kShortestS), kHigh = std::log(kLongestS);
  const auto sections = values.size() / 2;
  for (Eigen::Index i = 0; i < sections; ++i) {
    values[i] = std::clamp(values[i] + std::clamp(step[i], -kLargestStep, kLargestStep), kLow, kHigh);
    values[sections + i] = std::clamp(values[sections + i] + step[sections + i], -largest_gain_, largest_gain_);
  }
  return values;
}

// Levenberg and Marquardt for one p.
void Search::refine(Candidate& candidate, double power) {
  const int unknowns = static_cast<int>(candidate.values.size());
  double damping = 1e-3;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    evaluate(candidate.values, true);
    candidate.largest = 0;
    for (const double residual : residual_) candidate.largest = std::max(candidate.largest, std::abs(residual));
    const double scale = candidate.largest;
    if (scale < 1e-9) return;
    const double before = cost(power, scale);
    normal_equations(power, scale, unknowns);
    const double floor = 1e-14 * normal_.diagonal().maxCoeff();
    double improvement = 0;
    for (int attempt = 0; attempt < 10 && improvement <= 0; ++attempt) {
      Square damped = normal_;
      for (int i = 0; i < unknowns; ++i) damped(i, i) += damping * (normal_(i, i) + floor);
      const Column values = bounded(candidate.values, damped.ldlt().solve(descent_));
      evaluate(values, false);
      improvement = 1 - cost(power, scale) / before;
      if (improvement > 0) candidate.values = values;
      damping = improvement > 0 ? std::max(damping / 5, 1e-12) : damping * 6;
    }
    if (!(improvement > kLeastImprovement * power)) break;
  }
  evaluate(candidate.values, false);
  candidate.largest = 0;
  for (const double residual : residual_) candidate.largest = std::max(candidate.largest, std::abs(residual));
}

// Gains of least squares for the time constants of a row.
Candidate Search::start(int sections, std::size_t row, double time_scale_s) {
  Candidate candidate;
  candidate.values.setZero(2 * sections);
  for (int i = 0; i < sections; ++i) {
    candidate.values[i] = std::clamp(std::log(time_scale_s * kStarts[row][static_cast<std::size_t>(i)]),
                                     std::log(1.2 * kShortestS), std::log(kLongestS / 3));
  }
  evaluate(candidate.values, true);
  normal_equations(2, 1, 2 * sections);
  Square gains = normal_.bottomRightCorner(sections, sections);
  gains.diagonal().array() += kRidge * static_cast<double>(target_.tick.size());
  const Column solved = gains.ldlt().solve(descent_.tail(sections));
  for (int i = 0; i < sections; ++i)
    candidate.values[sections + i] = std::clamp(solved[i], -largest_gain_, largest_gain_);
  return candidate;
}

Candidate Search::best(int sections, double time_scale_s) {
  std::vector<Candidate> candidates;
  for (std::size_t row = 0; row < kStarts.size(); ++row) {
    candidates.push_back(start(sections, row, time_scale_s));
    refine(candidates.back(), 2);
  }
  std::ranges::sort(candidates, {}, &Candidate::largest);
  candidates.resize(kRefined);
  for (Candidate& candidate : candidates) {
    for (const double power : {4.0, 8.0, 16.0, 32.0, 64.0}) refine(candidate, power);
  }
  return *std::ranges::min_element(candidates, {}, &Candidate::largest);
}

double time_to_63_percent_s(const Target& target) {
  std::size_t n = 0;
  while (n + 1 < target.tick.size() && target.velocity[n] < 0.63) ++n;
  return target.tick[n] * kEstimatorPeriodS;
}

EstimatorSections sections_of(const Candidate& candidate, double final_velocity_m_s) {
  EstimatorSections sections;
  sections.time_constant_s.fill(1);
  for (int i = 0; i < candidate.sections(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    sections.gain_m_s[at] = static_cast<float>(final_velocity_m_s * candidate.values[candidate.sections() + i]);
    sections.time_constant_s[at] = static_cast<float>(std::exp(candidate.values[i]));
  }
  return sections;
}

double error_at_ticks(const EstimatorSections& sections, const Target& target, double final_velocity_m_s) {
  std::array<float, kEstimatorSections> share{}, section{};
  for (std::size_t i = 0; i < kEstimatorSections; ++i) {
    share[i] = decayed_share(static_cast<float>(kEstimatorPeriodS) / sections.time_constant_s[i]);
  }
  double largest = 0;
  auto compared = target.tick.begin();
  for (int tick = 1; tick <= kLastTick; ++tick) {
    float velocity_m_s = 0;
    for (std::size_t i = 0; i < kEstimatorSections; ++i) {
      section[i] += share[i] * (1 - section[i]);
      velocity_m_s += sections.gain_m_s[i] * section[i];
    }
    if (tick != *compared) continue;
    const double modelled = static_cast<double>(velocity_m_s) / final_velocity_m_s;
    largest = std::max(largest,
                       std::abs(modelled - target.velocity[static_cast<std::size_t>(compared - target.tick.begin())]));
    ++compared;
  }
  return largest;
}

// |error| at any time, with sections that decay between the ticks as they do from tick to tick.
class ErrorInTime {
 public:
  ErrorInTime(const EstimatorSections& sections, const FractionalModel& plant)
      : sections_{sections}, plant_{plant}, final_velocity_m_s_{plant.kp / plant.b3} {
    for (std::size_t i = 0; i < kEstimatorSections; ++i) {
      rate_[i] = log_decay(std::log(static_cast<double>(sections.time_constant_s[i]))) / kEstimatorPeriodS;
    }
  }

  std::vector<double> at(std::span<const double> time_s) const {
    std::vector<double> error = step_response(plant_, 1 / final_velocity_m_s_, time_s).velocity_m_s;
    for (std::size_t n = 0; n < time_s.size(); ++n) {
      double velocity_m_s = 0;
      for (std::size_t i = 0; i < kEstimatorSections; ++i) {
        velocity_m_s -= static_cast<double>(sections_.gain_m_s[i]) * std::expm1(rate_[i] * time_s[n]);
      }
      error[n] = std::abs(velocity_m_s / final_velocity_m_s_ - error[n]);
    }
    return error;
  }

  double peak_between(double low_s, double high_s) const {
    constexpr double kGolden = std::numbers::phi - 1;
    const auto at_one = [this](double time_s) { return at(std::span{&time_s, 1}).front(); };
    double a_s = high_s - kGolden * (high_s - low_s), b_s = low_s + kGolden * (high_s - low_s);
    double at_a = at_one(a_s), at_b = at_one(b_s);
    for (int step = 0; step < kPeakSteps; ++step) {
      if (at_a > at_b) {
        high_s = b_s, b_s = a_s, at_b = at_a;
        a_s = high_s - kGolden * (high_s - low_s), at_a = at_one(a_s);
      } else {
        low_s = a_s, a_s = b_s, at_a = at_b;
        b_s = low_s + kGolden * (high_s - low_s), at_b = at_one(b_s);
      }
    }
    return std::max(at_a, at_b);
  }

 private:
  const EstimatorSections& sections_;
  const FractionalModel& plant_;
  double final_velocity_m_s_;
  std::array<double, kEstimatorSections> rate_{};
};

double error_between_ticks(const EstimatorSections& sections, const FractionalModel& plant) {
  std::vector<double> time_s;
  for (double t_s = kEstimatorPeriodS; t_s < kLastTick * kEstimatorPeriodS; t_s *= kCompareRatio) time_s.push_back(t_s);
  time_s.push_back(kLastTick * kEstimatorPeriodS);
  const ErrorInTime in_time{sections, plant};
  const std::vector<double> error = in_time.at(time_s);
  const double sampled = *std::ranges::max_element(error);
  double largest = sampled;
  for (std::size_t n = 1; n + 1 < error.size(); ++n) {
    const bool is_peak = error[n] >= error[n - 1] && error[n] >= error[n + 1];
    if (is_peak && error[n] > kNearLargest * sampled) {
      largest = std::max(largest, in_time.peak_between(time_s[n - 1], time_s[n + 1]));
    }
  }
  return largest;
}

std::string reason_of(const FractionalModel& plant, double fit_error, const Target& target) {
  const double final_velocity_m_s = plant.kp / plant.b3;
  if (std::abs(final_velocity_m_s) > kLargestParameterM_S) {
    return base::join_text("the plant's final velocity is ", final_velocity_m_s,
                           " m/s per duty, and the robot's gains end at ", kLargestParameterM_S, " m/s");
  }
  const double overshoot = *std::ranges::max_element(target.velocity) - 1;
  return base::join_text(
      "four first-order sections come no nearer to the plant's step response than ", std::round(1e4 * fit_error) / 100,
      " % of the final velocity, and the robot needs ", 100 * kLargestFitError, " %",
      overshoot > kOvershoots ? base::join_text("; the plant overshoots by ", std::round(1e3 * overshoot) / 10,
                                                " %, which sections without oscillation follow badly")
                              : std::string{},
      plant.dead_time_s > 0 ? "; the plant has a dead time, and sections have none" : "");
}

}  // namespace

double fit_error(const EstimatorSections& sections, const FractionalModel& plant) {
  check(plant);
  const double at_ticks = error_at_ticks(sections, target_of(plant, kCompareRatio), plant.kp / plant.b3);
  return std::max(at_ticks, error_between_ticks(sections, plant));
}

EstimatorModel estimator_model(const FractionalModel& plant) {
  check(plant);
  const double final_velocity_m_s = plant.kp / plant.b3;
  const Target compared = target_of(plant, kCompareRatio);
  Target fitted = target_of(plant, kFitRatio);
  const double time_scale_s = time_to_63_percent_s(fitted);
  fitted.tick.push_back(kLateTick);
  fitted.velocity.push_back(1);
  Search search{fitted, std::min(kLargestGain, kLargestParameterM_S / std::abs(final_velocity_m_s))};
  EstimatorModel model;
  model.fit_error = std::numeric_limits<double>::infinity();
  for (int sections = 1; sections <= static_cast<int>(kEstimatorSections) && model.fit_error > kGoodEnough;
       ++sections) {
    const EstimatorSections found = sections_of(search.best(sections, time_scale_s), final_velocity_m_s);
    const double error = error_at_ticks(found, compared, final_velocity_m_s);
    if (error < model.fit_error) model.sections = found, model.fit_error = error;
  }
  model.fit_error = std::max(model.fit_error, error_between_ticks(model.sections, plant));
  // The error is relative to the final velocity: one that no robot reaches hides every other.
  model.is_met = model.fit_error <= kLargestFitError && std::abs(final_velocity_m_s) <= kLargestParameterM_S;
  if (!model.is_met) model.reason = reason_of(plant, model.fit_error, compared);
  return model;
}

}  // namespace control
