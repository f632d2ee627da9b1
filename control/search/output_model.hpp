// The output of a model for a recorded duty, and its derivative with respect to every parameter, without time stepping.
//
//   output = G c(parameters) + pole pair;  ∂c/∂q from ∂H/∂q = -H (∂D/∂q)/D                   (1)
//   pole pair: 2 Re[(r/p) (e^{pt} - 1)], dp/dq = -(∂D/∂q)/D'(p), r = kp/D'(p)                (2)
//   G: see modal_regressors.hpp
// Parameters q are ln kp, ln b1, ln b2, alpha, beta, in this order.
// The dead time is that of set_delay, whatever a model says: the search asks for many models with the same delay.
// Shapes:   output has one element per duty, jacobian is samples × 5; with means, as many rows again behind them: the
//           velocity's change since the sample before, by dt_s, which is the mean of the acceleration.
// Errors:   none thrown; a model so extreme that its output is no number gives one that is none either.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

#include "control/models/modal_regressors.hpp"

namespace control {

using ParameterGradient = std::array<Complex, 5>;

class OutputModel {
 public:
  // longest_dead_time_s > 0: delays will be asked for, which are no whole number of samples.
  OutputModel(Channel channel, double dt_s, std::vector<double> duty, double longest_dead_time_s, double tolerance);

  // Of an acceleration, for a SensorPath.
  static OutputModel with_means(double dt_s, const std::vector<double>& duty, double tolerance);

  Eigen::Index samples() const { return static_cast<Eigen::Index>(duty_.size()); }
  // False if stop said so on the way: then the output is of no use until a delay is set to the end.
  bool set_delay(double delay_s, const Stop& stop = {});

  Eigen::VectorXd output(const FractionalModel& model) const;
  Eigen::MatrixXd jacobian(const FractionalModel& model) const;
  // Derivative with respect to time; of no use if stop said so on the way.
  Eigen::VectorXd slope(const FractionalModel& model, const Stop& stop = {}) const;

 private:
  struct PolePair {
    Complex pole, residue;
    ParameterGradient pole_gradient, residue_gradient;
  };

  std::optional<PolePair> explicit_pole(const FractionalModel& model) const;
  Eigen::VectorXd weights(const FractionalModel& model, const std::optional<PolePair>& pair) const;
  Eigen::MatrixXd weight_gradients(const FractionalModel& model, const std::optional<PolePair>& pair) const;
  Eigen::MatrixXd own_jacobian(const FractionalModel& model) const;
  Eigen::VectorXd own_output(const FractionalModel& model) const;
  void add_pole_response(const PolePair& pair, Eigen::VectorXd& output) const;
  void add_pole_gradients(const PolePair& pair, Eigen::MatrixXd& jacobian) const;

  Channel channel_;
  double dt_s_;
  std::vector<double> duty_;
  ModalRegressors regressors_;
  double delay_s_ = 0;
  DelayedDuty delayed_;
  Eigen::MatrixXd responses_;
  std::unique_ptr<OutputModel> velocity_;  // with means
};

}  // namespace control
