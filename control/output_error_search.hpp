// Searches the parameters whose output is nearest to a recording.
//
//   minimise Σ_channels Σ_k (y_k - output_k(q) - offset)²/σ²_channel            (1)   σ: re-estimated, for two channels
//   minimise Σ_channels Σ_k |y_k - output_k(q) - offset|/σ_channel              (2)   reweighted least squares on (1)
//   q = ln kp, ln b1, ln b2, ln((α - 1)/(2 - α)), ln(β/(1 - β)), offset, ln(τ/(longest - τ))         (3)   no bounds
//   left
//
// Eigen's Levenberg-Marquardt (MINPACK's lmder) with the exact Jacobian. Every start's gain is the best for its other
// parameters, which are the Newtonian model's for the first: so the units of the output do not matter.
// Errors: none thrown; how a search ended is in the result.
#pragma once

#include <Eigen/Core>
#include <chrono>
#include <vector>

#include "control/identify.hpp"
#include "control/output_model.hpp"

namespace control {

struct SearchPoint {
  FractionalModel model;
  double offset_m = 0, dead_time_s = 0;
};

struct SearchResult {
  SearchPoint point;
  SearchEnd end = SearchEnd::converged;
  int iterations = 0, starts = 0, starts_that_agree = 0;
};

// What is free beside the model's own parameters follows the kParameters of these.
enum FreeParameter : int { kOffset = kParameters, kDeadTime };

class OutputErrorSearch {
 public:
  OutputErrorSearch(const Recording& recording, const IdentificationOptions& options);

  SearchResult run(Structure structure);

  std::vector<int> free_parameters(Structure structure) const;
  std::vector<Channel> channels() const;
  // One per channel, measured less output, in its own unit.
  std::vector<Eigen::VectorXd> residuals(const SearchPoint& point);
  // Of the outputs with respect to ln kp, ln b1, ln b2, alpha, beta, offset, dead time, as far as they are free.
  std::vector<Eigen::MatrixXd> jacobians(Structure structure, const SearchPoint& point);

 private:
  struct Measured {
    Channel channel;
    OutputModel model;
    Eigen::VectorXd measured;
    double sd;
    Eigen::VectorXd root_weight;
  };
  struct Descent;  // what Eigen's solver calls

  SearchPoint start(Structure structure, int index) const;
  void fit_gain(SearchPoint& point);
  void fit_dead_time(SearchPoint& point);
  SearchEnd descend(Structure structure, SearchPoint& point, int iteration_limit, Progress progress);
  void refine_channel_weights(Structure structure, SearchResult& result);
  void refine_absolute_error(Structure structure, SearchResult& result);
  double cost(const SearchPoint& point);                                             // (1)
  double absolute_cost(const SearchPoint& point);                                    // (2)
  Eigen::VectorXd coordinates(Structure structure, const SearchPoint& point) const;  // (3)
  SearchPoint point_at(Structure structure, const Eigen::VectorXd& x) const;
  Eigen::VectorXd coordinate_slopes(Structure structure, const SearchPoint& point) const;
  bool is_late() const { return std::chrono::steady_clock::now() >= deadline_; }

  IdentificationOptions options_;
  double dt_s_;
  Eigen::Index samples_;
  double offset_scale_m_ = 1;
  int last_iterations_ = 0;
  std::chrono::steady_clock::time_point deadline_;
  std::vector<Measured> measured_;
};

}  // namespace control
