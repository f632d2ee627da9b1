// How well planned experiments would determine a model's parameters, and duties for such plans.
//
// (5) is that of identify.hpp. Errors: throws std::invalid_argument quoting the bad value.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "control/search/fit.hpp"

namespace control {

// The uncertainty that a planned experiment would leave, with the model's dead time known: one-sigma of each parameter
// by (5), for white noise of these sizes (0: channel not recorded). Of an acceleration bias, drift and lag are never
// known.
struct PlannedExperiment {
  double dt_s = 0.01;
  std::vector<double> duty;
  double position_sd_m = 0;
  double velocity_sd_m_s = 0;
  bool fits_offset = false;
  double acceleration_sd_m_s2 = 0;
};

struct ExpectedUncertainty {
  std::array<std::optional<double>, kParameters> one_sigma;  // none: this experiment does not determine it
  std::array<std::array<double, kParameters>, kParameters> correlation{};
  double dead_time_sd_s = 0;  // taken as independent of the parameters; of a planned experiment it is known
};

ExpectedUncertainty expected_uncertainty(const FractionalModel& model, const PlannedExperiment& experiment);

// The same for several experiments on one robot in one fluid: each has unknowns of its own (offset, bias, drift, lag),
// and they share the model.
class ExpectedInformation {
 public:
  explicit ExpectedInformation(const FractionalModel& model);

  void add(const PlannedExperiment& experiment);
  void add(const ExpectedInformation& others, int times = 1);  // of the same model

  ExpectedUncertainty uncertainty() const;  // nothing is determined before the first experiment

 private:
  FractionalModel model_;
  Eigen::MatrixXd rows_;  // its Gram matrix is the information on the model's free parameters
};

// Duties for such plans: a step, and a pseudo-random binary sequence of ±amplitude.
std::vector<double> step_duty(double amplitude, double duration_s, double dt_s);
std::vector<double> prbs_duty(double amplitude, double bit_s, double duration_s, double dt_s);

}  // namespace control
