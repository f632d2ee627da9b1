// Predicts the uncertainty of a planned experiment's fit, and makes duties for it.
#include "control/identification/planned_experiment.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "base/invalid_argument.hpp"
#include "control/search/fit_statistics.hpp"
#include "control/search/output_model.hpp"

namespace control {
namespace {

using Eigen::Index;

constexpr double kModelTolerance = 1e-9;
constexpr double kLargestDuty = 1e3;
constexpr Index kSensorUnknowns = 3;  // of an acceleration: bias, drift, lag

[[noreturn]] void refuse(const char* what, double value) {
  base::throw_invalid("planned experiment: ", what, ' ', value);
}

void check(const PlannedExperiment& experiment) {
  if (!(experiment.dt_s >= 1e-6 && experiment.dt_s <= 1e4))
    refuse("dt_s must be from 1e-6 to 1e4, is", experiment.dt_s);
  if (experiment.duty.size() < 20) {
    refuse("duty must have at least 20 samples, has", static_cast<double>(experiment.duty.size()));
  }
  for (const double duty : experiment.duty) {
    if (!(std::abs(duty) <= kLargestDuty)) refuse("duty must be finite and at most 1000 in size, has", duty);
  }
  if (experiment.duty.size() > kMostSamples) {
    refuse("duty must have at most 200000 samples, has", static_cast<double>(experiment.duty.size()));
  }
  if (std::ranges::all_of(experiment.duty, [](double duty) { return duty == 0; })) {
    refuse("duty must not be zero throughout, which moves nothing; its first value is", experiment.duty.front());
  }
  const double position_sd_m = experiment.position_sd_m, velocity_sd_m_s = experiment.velocity_sd_m_s;
  if (!(position_sd_m >= 0 && std::isfinite(position_sd_m))) refuse("position_sd_m must be ≥ 0, is", position_sd_m);
  if (!(velocity_sd_m_s >= 0 && std::isfinite(velocity_sd_m_s))) {
    refuse("velocity_sd_m_s must be ≥ 0, is", velocity_sd_m_s);
  }
  const double acceleration_sd_m_s2 = experiment.acceleration_sd_m_s2;
  if (!(acceleration_sd_m_s2 >= 0 && std::isfinite(acceleration_sd_m_s2))) {
    refuse("acceleration_sd_m_s2 must be ≥ 0, is", acceleration_sd_m_s2);
  }
  if (position_sd_m == 0 && velocity_sd_m_s == 0 && acceleration_sd_m_s2 == 0) {
    refuse("one of the sd must be positive, all are", 0);
  }
}

std::vector<Index> free_parameters(const FractionalModel& model) {
  if (model.b1 == 0) return model.beta == 1 ? std::vector<Index>{0, 2} : std::vector<Index>{0, 2, 4};
  if (model.alpha == 2 && model.beta == 1) return {0, 1, 2};
  return {0, 1, 2, 3, 4};
}

void check_amplitude(double amplitude) {
  if (!(std::abs(amplitude) <= kLargestDuty)) refuse("amplitude must be finite and at most 1000, is", amplitude);
}

// What `of_model` says of the model while the unknowns of `of_others` are free too: the part of its columns that no
// combination of those can follow, as a triangle.
Eigen::MatrixXd without(const Eigen::MatrixXd& of_others, const Eigen::MatrixXd& of_model) {
  Eigen::MatrixXd left = of_model;
  if (of_others.cols() > 0) {
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> others(of_others);
    const Eigen::MatrixXd rotated = others.householderQ().adjoint() * of_model;
    left = rotated.bottomRows(rotated.rows() - others.rank());
  }
  const Eigen::HouseholderQR<Eigen::MatrixXd> rest(left);
  return rest.matrixQR().topRows(std::min(left.rows(), left.cols())).triangularView<Eigen::Upper>();
}

// A triangle with the information of both.
Eigen::MatrixXd joined(const Eigen::MatrixXd& one, const Eigen::MatrixXd& other) {
  if (one.rows() == 0) return other;
  Eigen::MatrixXd both(one.rows() + other.rows(), one.cols());
  both << one, other;
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(both);
  return qr.matrixQR().topRows(std::min(both.rows(), both.cols())).triangularView<Eigen::Upper>();
}

Index sample_count(double duration_s, double dt_s) {
  if (!(dt_s > 0 && std::isfinite(dt_s))) refuse("dt_s must be positive, is", dt_s);
  if (!(duration_s >= dt_s && std::round(duration_s / dt_s) < static_cast<double>(kMostSamples))) {
    refuse("duration_s must be between 1 and 199999 steps, is", duration_s);
  }
  return 1 + static_cast<Index>(std::lround(duration_s / dt_s));
}

}  // namespace

ExpectedInformation::ExpectedInformation(const FractionalModel& model) {
  check(model);
  model_ = normalised(model);
  rows_.resize(0, static_cast<Index>(free_parameters(model_).size()));
}

void ExpectedInformation::add(const PlannedExperiment& experiment) {
  check(experiment);
  const std::vector<Index> free = free_parameters(model_);
  const auto samples = static_cast<Index>(experiment.duty.size()), count = static_cast<Index>(free.size());
  const bool has_acceleration = experiment.acceleration_sd_m_s2 > 0;
  const Index sensor = experiment.fits_offset ? 1 : 0;
  Eigen::MatrixXd of_model(0, count), of_others(0, sensor + (has_acceleration ? kSensorUnknowns : 0));
  const auto add_channel = [&](Channel channel, double sd) {
    if (sd == 0) return;
    OutputModel output(channel, experiment.dt_s, experiment.duty, model_.dead_time_s, kModelTolerance);
    output.set_delay(model_.dead_time_s);
    const Index row = of_model.rows();
    of_model.conservativeResize(row + samples, Eigen::NoChange);
    of_others.conservativeResize(row + samples, Eigen::NoChange);
    of_others.bottomRows(samples).setZero();
    of_model.bottomRows(samples) = output.jacobian(model_)(Eigen::all, free) / sd;
    if (experiment.fits_offset) of_others.col(0).tail(samples).setConstant(channel == Channel::position ? 1 / sd : 0);
    if (channel == Channel::acceleration) {
      of_others.col(sensor).tail(samples).setConstant(1 / sd);
      of_others.col(sensor + 1).tail(samples).setLinSpaced(0, 1 / sd);
      of_others.col(sensor + 2).tail(samples) = output.slope(model_) / sd;
    }
  };
  add_channel(Channel::position, experiment.position_sd_m);
  add_channel(Channel::velocity, experiment.velocity_sd_m_s);
  add_channel(Channel::acceleration, experiment.acceleration_sd_m_s2);
  rows_ = joined(rows_, without(of_others, of_model));
}

void ExpectedInformation::add(const ExpectedInformation& others, int times) {
  const Eigen::MatrixXd added = others.rows_ * std::sqrt(static_cast<double>(times));
  rows_ = joined(rows_, added);
}

ExpectedUncertainty ExpectedInformation::uncertainty() const {
  ExpectedUncertainty result;
  if (rows_.rows() == 0) return result;
  const std::vector<Index> free = free_parameters(model_);
  const Uncertainty found = control::uncertainty(rows_);
  const std::array<double, kParameters> unit{std::abs(model_.kp), model_.b1, model_.b2, 1,
                                             1};  // ln kp to kp, and so on
  for (std::size_t i = 0; i < free.size(); ++i) {
    const auto row = static_cast<std::size_t>(free[i]);
    if (found.one_sigma[i]) result.one_sigma[row] = *found.one_sigma[i] * unit[row];
    for (std::size_t j = 0; j < free.size(); ++j) {
      result.correlation[row][static_cast<std::size_t>(free[j])] =
          found.correlation(static_cast<Index>(i), static_cast<Index>(j));
    }
  }
  return result;
}

ExpectedUncertainty expected_uncertainty(const FractionalModel& model, const PlannedExperiment& experiment) {
  ExpectedInformation information{model};
  information.add(experiment);
  return information.uncertainty();
}

std::vector<double> step_duty(double amplitude, double duration_s, double dt_s) {
  check_amplitude(amplitude);
  return std::vector<double>(static_cast<std::size_t>(sample_count(duration_s, dt_s)), amplitude);
}

// The bits of a 16-bit shift register with taps 16, 14, 13, 11, which repeat after 65535.
std::vector<double> prbs_duty(double amplitude, double bit_s, double duration_s, double dt_s) {
  check_amplitude(amplitude);
  if (!(bit_s >= dt_s)) refuse("bit_s must be at least dt_s, is", bit_s);
  const auto count = static_cast<std::size_t>(sample_count(duration_s, dt_s));
  std::vector<double> duty(count);
  std::uint32_t bits = 0xACE1;
  double bit_end_s = bit_s;
  for (std::size_t k = 0; k < count; ++k) {
    if (static_cast<double>(k) * dt_s > bit_end_s - 1e-6 * dt_s) {
      bits = (bits >> 1) | (((bits ^ (bits >> 2) ^ (bits >> 3) ^ (bits >> 5)) & 1) << 15);
      bit_end_s += bit_s;
    }
    duty[k] = (bits & 1) != 0 ? amplitude : -amplitude;
  }
  return duty;
}

}  // namespace control
