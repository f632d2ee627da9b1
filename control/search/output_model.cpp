// Weighs the responses of the fixed rates, and adds that of the pole pair.
#include "control/search/output_model.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "control/models/modal_form.hpp"

namespace control {
namespace {

using Eigen::Index;
using std::numbers::pi;

constexpr double kShortestShare = 1e-2;  // of a step, between a delayed change and a sample
constexpr Index kBlockRows = 512;        // six columns of them stay in the nearest cache

struct Terms {
  Complex first, second;  // b1 s^α, b2 s^β
};

Terms terms(const FractionalModel& model, Complex log_s) {
  return {model.b1 == 0 ? 0.0 : model.b1 * std::exp(model.alpha * log_s), model.b2 * std::exp(model.beta * log_s)};
}

// A rate that falls on the pole would give 0/0; what is left of H there is smooth, so a near value will do.
Complex beside(Complex s, Complex pole) { return std::abs(s - pole) > 1e-6 * std::abs(pole) ? s : s * (1 + 2e-6); }

// to += four columns, each times its weight.
void add_four(double* __restrict to, const double* const* columns, const double* weights, Index rows) {
  const double *a = columns[0], *b = columns[1], *c = columns[2], *d = columns[3];
  const double wa = weights[0], wb = weights[1], wc = weights[2], wd = weights[3];
  for (Index i = 0; i < rows; ++i) to[i] += wa * a[i] + wb * b[i] + wc * c[i] + wd * d[i];
}

// The responses times a few columns of weights, some rows after the other: a block of a response is read once for all
// columns. A general product would copy all responses first, which takes longer than the product.
Eigen::MatrixXd weighed(const Eigen::MatrixXd& responses, const Eigen::MatrixXd& weights) {
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(responses.rows(), weights.cols());
  const Index fours = responses.cols() / 4 * 4;
  for (Index row = 0; row < responses.rows(); row += kBlockRows) {
    const Index rows = std::min(kBlockRows, responses.rows() - row);
    for (Index k = 0; k < fours; k += 4) {
      const double* columns[4];
      for (Index i = 0; i < 4; ++i) columns[i] = responses.col(k + i).data() + row;
      for (Index j = 0; j < weights.cols(); ++j) {
        add_four(result.col(j).data() + row, columns, weights.col(j).data() + k, rows);
      }
    }
    for (Index k = fours; k < responses.cols(); ++k) {
      for (Index j = 0; j < weights.cols(); ++j) {
        result.col(j).segment(row, rows) += weights(k, j) * responses.col(k).segment(row, rows);
      }
    }
  }
  return result;
}

Eigen::MatrixXd before_means(const Eigen::MatrixXd& acceleration, const Eigen::MatrixXd& velocity, double dt_s) {
  const Index samples = acceleration.rows();
  Eigen::MatrixXd both = Eigen::MatrixXd::Zero(2 * samples, acceleration.cols());
  both.topRows(samples) = acceleration;
  both.bottomRows(samples - 1) = (velocity.bottomRows(samples - 1) - velocity.topRows(samples - 1)) / dt_s;
  return both;
}

}  // namespace

OutputModel::OutputModel(Channel channel, double dt_s, std::vector<double> duty, double longest_dead_time_s,
                         double tolerance)
    : channel_(channel),
      dt_s_(dt_s),
      duty_(std::move(duty)),
      regressors_(channel, dt_s, samples(), longest_dead_time_s > 0 ? kShortestShare * dt_s : dt_s, tolerance),
      delayed_(delayed(duty_, dt_s, 0)),
      responses_(regressors_.responses(delayed_)) {}

bool OutputModel::set_delay(double delay_s, const Stop& stop) {
  if (delay_s == delay_s_) return true;
  delay_s_ = std::numeric_limits<double>::quiet_NaN();  // equals none, if this is not brought to its end
  delayed_ = delayed(duty_, dt_s_, delay_s);
  responses_ = regressors_.responses(delayed_, stop);
  if (stop && stop()) return false;
  delay_s_ = delay_s;
  return true;
}

// None if it lies in the sector that the ray takes care of, or has decayed before the first sample.
std::optional<OutputModel::PolePair> OutputModel::explicit_pole(const FractionalModel& model) const {
  const std::optional<Complex> log_p = log_pole(model);
  if (!log_p || !(log_p->imag() < kLargestPoleAngle * pi)) return std::nullopt;
  if (!(log_p->real() < regressors_.log_rate().back().real() + 5)) return std::nullopt;
  const auto [first, second] = terms(model, *log_p);
  const double alpha = model.alpha, beta = model.beta;
  const Complex p = std::exp(*log_p), slope = (alpha * first + beta * second) / p;
  const Complex bend = (alpha * (alpha - 1) * first + beta * (beta - 1) * second) / (p * p);
  const ParameterGradient at_p{0, first, second, first * *log_p, second * *log_p};  // ∂D/∂q
  const ParameterGradient slope_at_p{0, alpha * first / p, beta * second / p, first * (1.0 + alpha * *log_p) / p,
                                     second * (1.0 + beta * *log_p) / p};
  PolePair pair{p, model.kp / slope, {}, {}};
  for (std::size_t q = 0; q < at_p.size(); ++q) {
    pair.pole_gradient[q] = -at_p[q] / slope;
    pair.residue_gradient[q] = -pair.residue / slope * (slope_at_p[q] + bend * pair.pole_gradient[q]);
  }
  pair.residue_gradient[0] = pair.residue;
  return pair;
}

Eigen::VectorXd OutputModel::weights(const FractionalModel& model, const std::optional<PolePair>& pair) const {
  const Index rates = static_cast<Index>(regressors_.log_rate().size());
  Eigen::VectorXd result(2 * rates);
  const Complex scale = regressors_.log_step() / Complex{0, 2 * pi};
  for (Index i = 0; i < rates; ++i) {
    const Complex log_s = regressors_.log_rate()[static_cast<std::size_t>(i)];
    Complex transfer = model.kp / denominator(model, log_s);
    if (pair) {
      const Complex s = beside(std::exp(log_s), pair->pole);
      transfer -= pair->residue / (s - pair->pole) + std::conj(pair->residue) / (s - std::conj(pair->pole));
    }
    const Complex weight = scale * transfer;
    result[i] = 2 * weight.real();
    result[i + rates] = -2 * weight.imag();
  }
  return result;
}

Eigen::MatrixXd OutputModel::weight_gradients(const FractionalModel& model, const std::optional<PolePair>& pair) const {
  const Index rates = static_cast<Index>(regressors_.log_rate().size());
  Eigen::MatrixXd result(2 * rates, 5);
  const Complex scale = regressors_.log_step() / Complex{0, 2 * pi};
  for (Index i = 0; i < rates; ++i) {
    const Complex log_s = regressors_.log_rate()[static_cast<std::size_t>(i)];
    const auto [first, second] = terms(model, log_s);
    const Complex inverse = 1.0 / (first + second + model.b3), transfer = model.kp * inverse;
    const Complex by_first = -transfer * inverse * first, by_second = -transfer * inverse * second;
    ParameterGradient gradient{transfer, by_first, by_second, by_first * log_s, by_second * log_s};
    if (pair) {
      const Complex s = beside(std::exp(log_s), pair->pole);
      const Complex a = 1.0 / (s - pair->pole), b = 1.0 / (s - std::conj(pair->pole));
      for (std::size_t q = 0; q < gradient.size(); ++q) {
        const Complex moved = pair->residue * pair->pole_gradient[q], grown = pair->residue_gradient[q];
        gradient[q] -= (grown + moved * a) * a + (std::conj(grown) + std::conj(moved) * b) * b;
      }
    }
    for (std::size_t q = 0; q < gradient.size(); ++q) {
      const Complex weight = scale * gradient[q];
      result(i, static_cast<Index>(q)) = 2 * weight.real();
      result(i + rates, static_cast<Index>(q)) = -2 * weight.imag();
    }
  }
  return result;
}

void OutputModel::add_pole_response(const PolePair& pair, Eigen::VectorXd& output) const {
  const Eigen::VectorXcd exponential = exponential_response(delayed_, pair.pole);
  if (channel_ == Channel::acceleration) {
    output += (2.0 * pair.residue * exponential).real();
    return;
  }
  const Complex gain = 2.0 * pair.residue / pair.pole, divisor = channel_ == Channel::velocity ? 1.0 : pair.pole;
  const Complex factor = gain / divisor;
  output += (factor * exponential).real() - factor.real() * delayed_.integral.col(0);
  if (channel_ == Channel::position) output -= gain.real() * delayed_.integral.col(1);
}

void OutputModel::add_pole_gradients(const PolePair& pair, Eigen::MatrixXd& jacobian) const {
  const Complex p = pair.pole, gain = 2.0 * pair.residue / p;
  const Eigen::VectorXcd exponential = exponential_response(delayed_, p);
  const Eigen::VectorXcd moved = exponential_response_slope(delayed_, p, exponential);
  const bool is_position = channel_ == Channel::position, is_acceleration = channel_ == Channel::acceleration;
  for (std::size_t q = 0; q < pair.pole_gradient.size(); ++q) {
    const Complex shift = pair.pole_gradient[q], gain_shift = (2.0 * pair.residue_gradient[q] - gain * shift) / p;
    Complex of_moved = gain * shift, of_exponential = gain_shift;
    if (is_position) {
      of_moved /= p;
      of_exponential = (gain_shift - gain * shift / p) / p;
    }
    if (is_acceleration) {
      of_moved *= p;
      of_exponential = 2.0 * pair.residue_gradient[q];
    }
    auto column = jacobian.col(static_cast<Index>(q));
    column += of_moved.real() * moved.real() - of_moved.imag() * moved.imag();
    column += of_exponential.real() * exponential.real() - of_exponential.imag() * exponential.imag();
    if (!is_acceleration) column -= of_exponential.real() * delayed_.integral.col(0);
    if (is_position) column -= gain_shift.real() * delayed_.integral.col(1);
  }
}

OutputModel OutputModel::with_means(double dt_s, const std::vector<double>& duty, double tolerance) {
  OutputModel model{Channel::acceleration, dt_s, duty, 0, tolerance};
  model.velocity_ = std::make_unique<OutputModel>(Channel::velocity, dt_s, duty, 0, tolerance);
  return model;
}

Eigen::VectorXd OutputModel::output(const FractionalModel& model) const {
  if (!velocity_) return own_output(model);
  return before_means(own_output(model), velocity_->own_output(model), dt_s_);
}

Eigen::MatrixXd OutputModel::jacobian(const FractionalModel& model) const {
  if (!velocity_) return own_jacobian(model);
  return before_means(own_jacobian(model), velocity_->own_jacobian(model), dt_s_);
}

Eigen::VectorXd OutputModel::own_output(const FractionalModel& model) const {
  const std::optional<PolePair> pair = explicit_pole(model);
  Eigen::VectorXd result = weighed(responses_, regressors_.expansion() * weights(model, pair));  // (1)
  if (pair) add_pole_response(*pair, result);                                                    // (2)
  return result;
}

Eigen::MatrixXd OutputModel::own_jacobian(const FractionalModel& model) const {
  const std::optional<PolePair> pair = explicit_pole(model);
  Eigen::MatrixXd result = weighed(responses_, regressors_.expansion() * weight_gradients(model, pair));
  if (pair) add_pole_gradients(*pair, result);
  return result;
}

Eigen::VectorXd OutputModel::slope(const FractionalModel& model, const Stop& stop) const {
  const std::optional<PolePair> pair = explicit_pole(model);
  Eigen::VectorXd result =
      regressors_.response_slopes(delayed_, stop) * (regressors_.expansion() * weights(model, pair));
  if (!pair) return result;
  const Eigen::VectorXcd exponential = exponential_response(delayed_, pair->pole);
  const Complex gain = 2.0 * pair->residue / pair->pole;
  if (channel_ == Channel::acceleration) return result + (gain * pair->pole * pair->pole * exponential).real();
  if (channel_ == Channel::velocity) return result + (gain * pair->pole * exponential).real();
  return result + (gain * exponential).real() - gain.real() * delayed_.integral.col(0);
}

}  // namespace control
