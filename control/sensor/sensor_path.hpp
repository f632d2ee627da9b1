// From a model's acceleration at the ticks to the readings of an accelerometer that has a clock of its own.
//
//   τ f' = a - f,  a a parabola between ticks, of the tick's mean     (1)   the sensor's low pass
//   r_k = f(A + P j_k) + bias(t_k) + noise,  f linear between ticks   (2)   the sample that tick k reads
//   j_k = floor((t_k - W)/P')                                         (3)   the latest that there is then
//   bias(t): linear between knots that are equally spaced             (4)
//   A → first_s, P → period_s, τ → time_constant_s;  W → first_available_s;  W - A: the lag of a sample
//
// A dead time of whole ticks delays a before (1). P' is P, found apart from it: P and A move (2) smoothly, W and P'
// change which sample a tick reads, in jumps. A sensor whose samples keep step with the ticks has P = P' = dt. The bias
// is not a parameter: weighed() takes the best one off. Readings without weight: the same sample read again; one whose
// sample is uncertain, W being known to `guard_s` only; one of a tick that was missed; one that repeats the last
// although the model moves on by more than 3 sd, which is a failed read.
//
// A motion is what OutputModel::with_means gives: a at the ticks, and behind it its mean over the tick before each.
// The means count where a robot begins to move as v ~ t^α: a straight line from tick to tick misses 1 - α/2 of what v
// gains in the first.
// Shapes:   one value per tick, two of a motion.
// Accuracy: (1) and (2) are exact for what they say; a real acceleration is no parabola within a tick.
// Errors:   none thrown.
#pragma once

#include <Eigen/Core>
#include <Eigen/QR>

#include "control/sensor/sensor_readings.hpp"

namespace control {

struct SensorTiming {
  double first_s = 0;          // A
  double period_s = 0.01;      // P
  double time_constant_s = 0;  // τ
};

struct ReadOrder {
  double first_available_s = 0;  // W
  double period_s = 0.01;        // P'
};

class SensorPath {
 public:
  // is_missed: ticks without a reading; is_left_out: ticks whose reading does not count; empty: none.
  SensorPath(SensorReadings readings, double dt_s, std::vector<bool> is_missed = {},
             std::vector<bool> is_left_out = {});

  Eigen::Index samples() const { return reading_m_s2_.size(); }
  double dt_s() const { return dt_s_; }
  const Eigen::VectorXd& readings() const { return reading_m_s2_; }
  const std::vector<bool>& is_repeated() const { return is_repeated_; }
  bool readings_are_recovered() const { return are_recovered_; }

  // In step with the ticks, or in an order of its own.
  void set_in_step();
  bool set_order(const ReadOrder& order, double guard_s);  // whether a tick reads another sample than before
  // Leaves out failed reads; expected: what sampled() makes of a model.
  void leave_out_failed_reads(const Eigen::VectorXd& expected_m_s2, double sd_m_s2);
  void set_delay(Eigen::Index ticks) { delay_ticks_ = ticks; }
  Eigen::Index delay_ticks() const { return delay_ticks_; }
  bool has_own_clock() const { return has_own_clock_; }
  const ReadOrder& order() const { return order_; }
  Eigen::Index bias_terms() const { return knots_.cols(); }
  Eigen::Index weighed_samples() const { return static_cast<Eigen::Index>((weight_.array() > 0).count()); }

  Eigen::VectorXd delayed(const Eigen::VectorXd& values) const;                                   // by the dead time
  Eigen::VectorXd filtered(const Eigen::VectorXd& motion_m_s2, double time_constant_s) const;     // (1)
  Eigen::VectorXd sampled(const Eigen::VectorXd& motion_m_s2, const SensorTiming& timing) const;  // (1), (2)
  Eigen::MatrixXd timing_slopes(const Eigen::VectorXd& motion_m_s2, const SensorTiming& timing) const;  // A, P, τ
  // Less the bias (4) that suits it best, and 0 where the reading has no weight.
  Eigen::VectorXd weighed(const Eigen::VectorXd& values) const;
  Eigen::VectorXd with_weight(const Eigen::VectorXd& values) const;  // only those of readings that have some
  Eigen::VectorXd bias(const Eigen::VectorXd& residual_m_s2) const;  // the best one, at every tick

 private:
  void bridge_missed();
  void set_weights();
  double place(Eigen::Index tick, const SensorTiming& timing) const;  // of its sample, in ticks

  double dt_s_;
  Eigen::Index delay_ticks_ = 0;
  Eigen::VectorXd reading_m_s2_;
  std::vector<bool> is_repeated_, is_missed_, is_left_out_;
  bool are_recovered_;
  bool has_own_clock_ = false;
  ReadOrder order_;
  Eigen::VectorXd number_;  // j
  Eigen::VectorXd weight_;  // 0 or 1
  Eigen::MatrixXd knots_;   // of (4)
  Eigen::HouseholderQR<Eigen::MatrixXd> weighed_knots_;
};

}  // namespace control
