// Searches the parameters of one model that is nearest to several recordings together.
//
//   minimise Σ_runs Σ_channels Σ_k (y_k - output_k(q, n_run))²/σ²_run,channel             (1)   σ: re-estimated
//   minimise Σ_runs Σ_channels Σ_k |y_k - output_k(q, n_run)|/σ_run,channel               (2)   reweighted (1)
//   q: the model's parameters and its dead time, common to all runs                          (3)
//   n: what belongs to one run: offset, clock of its position, the sensor's clock, low pass and bias
//
// Each run keeps an OutputErrorSearch of its own, which reads its recording and knows its further unknowns; which
// sample each tick reads is found there, from that run alone. Starts are those of the longest run; their gain and
// offsets are the best for the other parameters. A dead time of accelerations only is in the ages of their readings.
// Errors: none thrown; how a search ended is in the result.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "control/search/fit.hpp"
#include "control/search/output_error_search.hpp"
#include "control/search/search_limit.hpp"

namespace control {

struct JointResult {
  std::vector<SearchPoint> points;  // one per run, of one model
  SearchEnd end = SearchEnd::converged;
  int iterations = 0, starts = 0, starts_that_agree = 0;
};

// Where the free parameters of the runs are among all: those of (3) first.
struct JointColumns {
  int common = 0, all = 0;
  std::vector<std::vector<Eigen::Index>> of_run;  // as free_parameters() of the run has them
};

class JointSearch {
 public:
  JointSearch(std::span<const Recording> recordings, const IdentificationOptions& options,
              const SearchLimit::Clock& clock = steady_now_s);

  std::size_t runs() const { return searches_.size(); }
  std::size_t longest() const { return longest_; }  // of the runs, by its samples
  OutputErrorSearch& of_run(std::size_t run) { return *searches_[run]; }

  // The same for each recorded acceleration. Call it before the first run().
  void find_sensors();
  // With no time at all the result is the paper's start.
  JointResult run(Structure structure);
  bool is_out_of_time() const;  // of all together, or of the search of one run
  JointColumns columns(Structure structure) const;

 private:
  // Of one channel of one run.
  struct Weight {
    double sd = 1;
    Eigen::VectorXd root_weight;
  };
  using Points = std::vector<SearchPoint>;

  void reset_weights();
  Points start(Structure structure, int index);
  void fit_gain(Structure structure, Points& points);
  void run_starts(Structure structure, JointResult& result);
  void refine_weights(Structure structure, JointResult& result);
  void refine_absolute_error(Structure structure, JointResult& result);
  SearchEnd descend(Structure structure, Points& points, int iteration_limit, Progress progress,
                    const KnownMinimum* known = nullptr);
  double absolute_cost(Structure structure, const Points& points);  // (2)
  double prior_weight(std::size_t run) const;
  Eigen::VectorXd coordinates(Structure structure, const Points& points) const;
  Points points_at(Structure structure, const Eigen::VectorXd& x) const;
  bool residuals_at(Structure structure, const Eigen::VectorXd& x, Eigen::VectorXd& residual);
  bool slopes_at(Structure structure, const Eigen::VectorXd& x, Eigen::MatrixXd& slopes);
  double sse_of(const Eigen::VectorXd& residual) const;

  IdentificationOptions options_;
  SearchLimit limit_;
  std::vector<std::unique_ptr<OutputErrorSearch>> searches_;
  std::vector<std::vector<Weight>> weights_;  // by run and channel
  std::vector<Eigen::Index> prior_values_;    // by run, of the descent that goes on
  bool is_of_absolute_error_ = false;
  std::size_t longest_ = 0;
  int last_iterations_ = 0;
  double last_cost_ = 0;
};

}  // namespace control
