// Reads a model's position, which is known at the ticks of a record, at the times at which it was measured.
//
//   p(t) = the cubic through the four ticks around t                                        (1)
// Before the first tick the model rests, after the last it goes on straight: a clock that is a little off reads there.
// Shapes:   one value per time; inputs have one value per tick.
// Accuracy: 3 µm for (29) with 10 ms ticks under full duty, held by reference_fit_test.cpp.
// Errors:   none thrown.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace control {

class PositionTimes {
 public:
  // Without sd_m all positions weigh the same.
  PositionTimes(std::vector<double> time_s, double dt_s, const std::vector<double>& sd_m = {});

  Eigen::Index size() const { return static_cast<Eigen::Index>(time_s_.size()); }
  // At each time plus shift_s; its derivative with respect to shift_s.
  Eigen::VectorXd read(const Eigen::VectorXd& at_ticks, double shift_s) const;
  Eigen::VectorXd slope(const Eigen::VectorXd& at_ticks, double shift_s) const;
  Eigen::VectorXd weighed(const Eigen::VectorXd& values) const;  // by (1) of position_weight.hpp

 private:
  std::vector<double> time_s_;
  double dt_s_;
  Eigen::VectorXd weight_;
};

}  // namespace control
