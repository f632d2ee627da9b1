// Searches the parameters whose output is nearest to a recording.
//
//   minimise Σ_channels Σ_k (y_k - output_k(q) - offset)²/σ²_channel            (1)   σ: re-estimated, for two channels
//   minimise Σ_channels Σ_k |y_k - output_k(q) - offset|/σ_channel              (2)   reweighted least squares on (1)
//   of the acceleration: y - output as a SensorPath reads it, its bias taken off                 (4)
//   of a position with times of its own: y - output at these times plus a shift - offset           (5)   weighed by
//   (1) of position_weight.hpp
//   q = ln kp, ln b1, ln b2, ln((α - 1)/(2 - α)), ln(β/(1 - β)), offset, ln(τ/(longest - τ))         (3)   unbounded
//   of the acceleration besides: Σ_j ((n_j - data sheet)/sd_j)², n: the sensor's lag, clock and low pass   (6)
//   in units of the noise, sensor_prior.hpp; (1) is minimised together with it
//
// Each start descends (descent.hpp). Its gain is the best for its other parameters, which are the Newtonian model's for
// the first: so the units of the output do not matter. The dead time's start is scanned for on a short piece of the
// record. The limits are asked for between all steps, and inside those that are long; a start that was cut off before
// its first iteration does not count. Errors: none thrown; how a search ended is in the result.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "control/search/descent.hpp"
#include "control/search/fit.hpp"
#include "control/search/output_model.hpp"
#include "control/search/search_limit.hpp"
#include "control/sensor/position_times.hpp"
#include "control/sensor/sensor_path.hpp"

namespace control {

inline constexpr double kModelTolerance = 1e-14;  // of the outputs

struct SearchPoint {
  FractionalModel model;
  double offset_m = 0;
  SensorTiming sensor = {};
  double position_clock_s = 0;  // the shift of (5)
};

struct SearchResult {
  SearchPoint point;
  SearchEnd end = SearchEnd::converged;
  int iterations = 0, starts = 0, starts_that_agree = 0;
};

// What is free beside the model's own parameters follows the kParameters of these.
inline constexpr int kOffset = kParameters;
inline constexpr int kDeadTime = kOffset + 1;
inline constexpr int kSensorTime = kOffset + 2;
inline constexpr int kSensorPeriod = kOffset + 3;
inline constexpr int kSensorTimeConstant = kOffset + 4;
inline constexpr int kPositionClock = kOffset + 5;

class OutputErrorSearch {
 public:
  OutputErrorSearch(const Recording& recording, const IdentificationOptions& options,
                    SearchLimit::Clock clock = steady_now_s);

  // With no time at all the result is the paper's start.
  SearchResult run(Structure structure);

  // Finds which sample each tick of a recorded acceleration reads. Call it before the first run().
  void find_sensor();
  std::optional<SensorFit> sensor_fit(const SearchPoint& point);  // none: no acceleration was recorded
  double sensor_lag_s(const SearchPoint& point) const;            // dead time and all, its sampling aside
  double dead_time_s(const SearchPoint& point) const;
  // Of an acceleration: the search puts every delay into the sensor's timing. Of a model whose dead time is given, the
  // readings come later than that, by no more than a search without a dead time lets them: nothing else is the
  // sensor's.
  void keep_dead_time(double dead_time_s, SearchPoint& point) const;
  const SensorPath* sensor() const { return measured_.front().path.get(); }
  const PositionTimes* position_times() const { return measured_.front().times.get(); }

  SearchPoint start(Structure structure, int index) const;
  // The best gain, and offset if it is fitted; false, with a positive stand-in, if the best gain is not positive.
  bool fit_gain(SearchPoint& point);
  // Of a position: the dead time that suits the other parameters best, of those that are tried on a short piece.
  void fit_dead_time(SearchPoint& point);
  std::vector<int> free_parameters(Structure structure) const;
  // The unbounded coordinates of the free parameters, and the derivative of each parameter with respect to its own.
  Eigen::VectorXd coordinates(Structure structure, const SearchPoint& point) const;  // (3)
  SearchPoint point_at(Structure structure, const Eigen::VectorXd& x) const;
  Eigen::VectorXd coordinate_slopes(Structure structure, const SearchPoint& point) const;
  Eigen::VectorXd counted(const Eigen::VectorXd& residual) const;  // only of what was measured and has weight
  double spread_of(std::size_t channel) const;                     // the sd of all that was measured of it
  std::vector<Channel> channels() const;
  const SearchLimit& limit() const { return limit_; }
  long outputs_computed() const { return outputs_computed_; }  // of one channel each
  // One per channel, measured less output, in its own unit.
  std::vector<Eigen::VectorXd> residuals(const SearchPoint& point);
  // Of the outputs with respect to ln kp, ln b1, ln b2, alpha, beta, offset, dead time, as far as they are free.
  std::vector<Eigen::MatrixXd> jacobians(Structure structure, const SearchPoint& point);
  // The prior of the sensor, once it is found: (6) of each of its free parameters in sds, and its slopes by the free
  // parameters.
  Eigen::VectorXd prior_residuals(Structure structure, const SearchPoint& point) const;
  Eigen::MatrixXd prior_slopes(Structure structure, const SearchPoint& point) const;
  double reading_sd_m_s2() const { return reading_sd_m_s2_; }  // of the noise in which (6) counts
  // By the model's five parameters, as they are measured, if the duty had been this one; and the model's velocity.
  std::vector<Eigen::MatrixXd> model_slopes(const std::vector<double>& duty, const SearchPoint& point) const;
  std::vector<double> model_velocity_m_s(const SearchPoint& point);
  // The output as it is measured, late by each of `samples`: a column each.
  std::vector<Eigen::MatrixXd> late_outputs(const std::vector<Eigen::Index>& samples, const SearchPoint& point);

 private:
  struct Measured {
    Channel channel;
    OutputModel model;
    Eigen::VectorXd measured;  // weighed, of a position with sds of its own
    double sd;
    Eigen::VectorXd root_weight;
    std::unique_ptr<SensorPath> path = nullptr;      // of an acceleration
    std::unique_ptr<PositionTimes> times = nullptr;  // of a position that has its own
  };

  // The output, or a column of its slopes, as it is measured.
  Eigen::VectorXd seen(const Measured& measured, const SearchPoint& point, const Eigen::VectorXd& output) const;
  Eigen::VectorXd seen_offset(const Measured& measured) const;  // of 1 m
  SensorTiming rough_timing() const;
  SensorTiming sensor_start(int index) const;
  double earliest_sample_s() const;
  double record_ticks() const { return static_cast<double>(samples_); }
  void find_delay(SearchPoint& point);
  bool find_own_clock(SearchPoint& point);
  bool descend_again(SearchPoint& point);
  double sensor_sd(const SearchPoint& point);  // of a reading
  void set_reading_sd(double sd_m_s2);
  std::vector<int> parameters_with_prior(Structure structure) const;
  double reading_lag_s(const SearchPoint& point) const;  // dead time and all, its sampling aside
  void run_starts(Structure structure, SearchResult& result);
  void make_scan(const Recording& recording);
  SearchEnd descend(Structure structure, SearchPoint& point, int iteration_limit, Progress progress,
                    const KnownMinimum* known = nullptr);
  // What it minimises; false: the limit is reached.
  bool weighed_residuals(Structure structure, const SearchPoint& point, Eigen::VectorXd& residual);
  bool weighed_slopes(Structure structure, const SearchPoint& point, Eigen::MatrixXd& slopes);  // by (3)
  void refine_channel_weights(Structure structure, SearchResult& result);
  void refine_absolute_error(Structure structure, SearchResult& result);
  double cost(const SearchPoint& point);                                // (1)
  double absolute_cost(Structure structure, const SearchPoint& point);  // (2)

  IdentificationOptions options_;
  double dt_s_;
  Eigen::Index samples_;
  Eigen::VectorXd
      counts_;         // 1, or 0 at a tick that does not count; empty: every value of a channel without a sensor counts
  Eigen::Index rows_;  // measured values of each channel: samples_, or of a position with times of its own their number
  double offset_scale_m_ = 1;
  bool sensor_is_found_ = false;
  SearchPoint sensor_start_;                       // what the search for it ended with
  double reading_sd_m_s2_ = 0, prior_weight_ = 0;  // the noise of a reading; the root of the weight of (6) in (1)
  int last_iterations_ = 0;
  double last_cost_ = 0;  // of the last descent, by its own weights
  long outputs_computed_ = 0;
  SearchLimit limit_;
  Stop stop_;  // asks the limit while a search runs; empty else, so that what was found can be looked at
  std::vector<Measured> measured_;
  std::unique_ptr<OutputErrorSearch> scan_;  // of a short piece, for the dead time; none if the record is short
};

}  // namespace control
