// Runs one estimator for its gains, and with them a covariance for each source.
#include "control/responses/measured_spread.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/invalid_argument.hpp"

namespace control {
namespace {

using Eigen::Index;
using Matrix = Eigen::MatrixXd;

constexpr double kRest_s = 3;
constexpr double kAge_s = 0.004;             // of a reading, sd about the middle of a tick, low pass included
constexpr double kClockSd = 0.005;           // of the sensor's clock, relative: sensor/sensor_prior.hpp
constexpr double kShapeCorrelation_s = 0.1;  // the robot's estimator reckons with more of an assumed model

// Rows of s in (5); the controller's states follow.
constexpr Index kVelocity = 1, kBias = 2, kGain = 3;
constexpr Index kSection = kEstimateErrors, kPosition = kSection + static_cast<Index>(kEstimateSections);
constexpr Index kDuty = kPosition + 1, kFloor = kDuty + 1, kShape = kFloor + 1, kController = kShape + 1;

double square(double x) { return x * x; }
double kept(double correlation_s) { return std::exp(-kEstimateTick_s / correlation_s); }

// A of (5) at one tick.
class Loop {
 public:
  explicit Loop(const LoopParts& parts)
      : parts_{parts}, floor_kept_{kept(parts.estimate.correlation_s)}, shape_kept_{kept(kShapeCorrelation_s)} {
    for (std::size_t i = 0; i < kEstimateSections; ++i) share_[i] = section_share(parts.time_constant_s[i]);
  }

  Index rows() const {
    const auto& controller = parts_.controller;
    return kController + static_cast<Index>(controller.first_order.size() + 2 * controller.second_order.size());
  }
  double floor_kept() const { return floor_kept_; }
  double shape_kept() const { return shape_kept_; }

  // A s, for every column of s. `compares`: the estimator's (3) is in this tick.
  void advance(Matrix& s, const EstimatorCovariance& estimator, bool compares, LoopTick tick, bool begins_auto) const {
    move(s);
    s.row(0) += kEstimateTick_s * (s.row(kVelocity) - kEstimateTick_s / 2 * s.row(kBias));
    s.row(kVelocity) -= kEstimateTick_s * s.row(kBias);
    s.row(kFloor) *= floor_kept_;
    s.row(kShape) *= shape_kept_;
    if (compares) compare(s, estimator);
    control(s, tick, begins_auto);
  }

 private:
  // (2)
  void move(Matrix& s) const {
    for (std::size_t i = 0; i < kEstimateSections; ++i) {
      auto section = s.row(kSection + static_cast<Index>(i));
      s.row(kPosition) += kEstimateTick_s / 2 * parts_.gain_m_s[i] * section;
      section += share_[i] * (s.row(kDuty) - section);
      s.row(kPosition) += kEstimateTick_s / 2 * parts_.gain_m_s[i] * section;
    }
  }

  // (3) with (4); of a confirmed model the gains are the plant's, whose error is not of these sources.
  void compare(Matrix& s, const EstimatorCovariance& estimator) const {
    const bool is_confirmed = parts_.estimate.is_confirmed;
    const double floor_m_s = is_confirmed ? 0 : estimator.velocity_floor_m_s();
    const double shape = is_confirmed ? parts_.model_error : parts_.estimate.shape_error;
    Eigen::RowVectorXd innovation = floor_m_s * s.row(kFloor) - s.row(kVelocity);
    innovation += shape * estimator.model_velocity_m_s() * s.row(kShape);
    for (std::size_t i = 0; i < kEstimateSections; ++i) {
      innovation += estimator.section_outputs()[i] * s.row(kGain + static_cast<Index>(i));
    }
    for (Index i = 0; i < kEstimateErrors; ++i) s.row(i) += estimator.gains()(i) * innovation;
  }

  // (1)
  void control(Matrix& s, LoopTick tick, bool begins_auto) const {
    if (begins_auto) s.bottomRows(s.rows() - kController).setZero();
    if (tick == LoopTick::duty_given) {
      s.row(kDuty).setZero();
      return;
    }
    const Eigen::RowVectorXd error = -(s.row(0) + s.row(kPosition));
    Eigen::RowVectorXd duty = parts_.controller.direct * error;
    Index at = kController;
    for (const FirstOrderSection& section : parts_.controller.first_order) {
      s.row(at) = section.residue * error + section.pole * s.row(at);
      duty += s.row(at++);
    }
    for (const SecondOrderSection& section : parts_.controller.second_order) {
      const Eigen::RowVectorXd output = section.b0 * error + s.row(at);
      s.row(at) = section.b1 * error - section.a1 * output + s.row(at + 1);
      s.row(at + 1) = -section.a2 * output;
      duty += output;
      at += 2;
    }
    if (tick == LoopTick::clipped) duty.setZero();
    s.row(kDuty) = duty;
  }

  const LoopParts& parts_;
  std::array<double, kEstimateSections> share_{};
  double floor_kept_, shape_kept_;
};

// P of each source. The age of the readings is one number for the whole run: a column in place of a covariance.
struct Sources {
  explicit Sources(Index rows)
      : estimator{Matrix::Zero(rows, rows)}, sensor{estimator}, start{estimator}, age{Matrix::Zero(rows, 1)} {}

  // A reading is skipped or repeated once in 1/|P/dt - 1| ticks, and the velocity misses a tick's change by it.
  void admit(const Loop& loop, const EstimateParameters& estimate, double change_m_s, double change_before_m_s) {
    const double slips = kClockSd * std::sqrt(2 / std::numbers::pi);
    sensor(kVelocity, kVelocity) += square(estimate.noise_m_s2 * kEstimateTick_s) + slips * square(change_m_s);
    sensor(kBias, kBias) += square(estimate.bias_walk_m_s2) * kEstimateTick_s;
    age(kVelocity, 0) -= kAge_s * (change_m_s - change_before_m_s) / kEstimateTick_s;
    estimator(kFloor, kFloor) += (1 - square(loop.floor_kept())) / square(loop.floor_kept());  // so that it stays at 1
    estimator(kShape, kShape) += (1 - square(loop.shape_kept())) / square(loop.shape_kept());
  }

  void note(MeasuredSpread& spread) const {
    const auto measured = [](const Matrix& p) { return p(0, 0) + p(kPosition, kPosition) + 2 * p(0, kPosition); };
    const auto sd = [](double variance) { return std::sqrt(std::max(variance, 0.0)); };
    spread.estimator_m.push_back(sd(measured(estimator)));
    spread.sensor_m.push_back(sd(measured(sensor) + square(age(0, 0) + age(kPosition, 0))));
    spread.start_m.push_back(sd(measured(start)));
    spread.true_m.push_back(sd(estimator(kPosition, kPosition) + sensor(kPosition, kPosition) +
                               start(kPosition, kPosition) + square(age(kPosition, 0))));
  }

  Matrix estimator, sensor, start, age;
};

}  // namespace

MeasuredSpread measured_spread(const LoopMotion& motion, const LoopParts& parts) {
  const std::size_t ticks = motion.ticks.size();
  if (motion.duty.size() != ticks || motion.velocity_m_s.size() != ticks) {
    base::throw_invalid("a motion has ", motion.duty.size(), " duties, ", motion.velocity_m_s.size(),
                        " velocities and ", ticks, " ticks: they must be equally many");
  }
  EstimatorCovariance estimator{parts.estimate};
  for (double at_s = 0; at_s < kRest_s; at_s += kEstimateTick_s) estimator.step(0, 0);
  estimator.zero_position();
  const Loop loop{parts};
  Sources sources{loop.rows()};
  sources.start.block<2, 2>(kVelocity, kVelocity) = estimator.covariance().block<2, 2>(kVelocity, kVelocity);
  sources.estimator(kFloor, kFloor) = sources.estimator(kShape, kShape) = 1;
  if (!parts.estimate.is_confirmed) {
    sources.estimator.block<kEstimateSections, kEstimateSections>(kGain, kGain) =
        estimator.covariance().bottomRightCorner<kEstimateSections, kEstimateSections>();
  }
  MeasuredSpread spread;
  double change_before_m_s = 0;
  for (std::size_t k = 0; k < ticks; ++k) {
    const double change_m_s = k == 0 ? 0 : motion.velocity_m_s[k] - motion.velocity_m_s[k - 1];
    const bool compares = k > 0 && estimator.step(motion.duty[k - 1], change_m_s);
    const bool is_auto = motion.ticks[k] != LoopTick::duty_given;
    const bool begins_auto = is_auto && (k == 0 || motion.ticks[k - 1] == LoopTick::duty_given);
    if (k > 0) sources.admit(loop, parts.estimate, change_m_s, change_before_m_s);
    change_before_m_s = change_m_s;
    for (Matrix* p : {&sources.estimator, &sources.sensor, &sources.start}) {
      loop.advance(*p, estimator, compares, motion.ticks[k], begins_auto);
      p->transposeInPlace();  // P is symmetric: A (A P)ᵀ is A P Aᵀ
      loop.advance(*p, estimator, compares, motion.ticks[k], begins_auto);
    }
    loop.advance(sources.age, estimator, compares, motion.ticks[k], begins_auto);
    sources.note(spread);
  }
  return spread;
}

}  // namespace control
