// Finds the clock of an accelerometer from its readings and a model's prediction.
//
// Where the acceleration changes fast, the shift that fits a piece of ten readings best is their age s.
// Samples lie at A + P j, so exp(2πi (s - t)/P) has the same angle for all pieces: P is where these agree best, A the
// angle.  (1) The sample that each tick reads is then found by comparing all near orders by their limited squared
// residuals; a sample read again must repeat the last reading, which a new one rarely does. (2) Both can be stopped
// between steps: then there is no clock, and the order is the best so far. Errors: none thrown; no clock where
// no piece changes fast enough for that.
#pragma once

#include <optional>

#include "control/models/modal_regressors.hpp"
#include "control/sensor/sensor_path.hpp"

namespace control {

struct SensorClock {
  SensorTiming timing;
  ReadOrder order;
};

// expected: the model's acceleration after the low pass, at the ticks; readings: without their bias.
struct ClockEvidence {
  double dt_s = 0.01;
  const Eigen::VectorXd& expected_m_s2;
  const Eigen::VectorXd& reading_m_s2;
  const std::vector<bool>& is_repeated;
  double sd_m_s2 = 0;
  Stop stop = {};

  bool is_stopped() const { return stop && stop(); }
};

std::optional<SensorClock> find_clock(const ClockEvidence& evidence, double time_constant_s);  // (1)

// The best order within `range_s` of the given one.
ReadOrder find_order(const ClockEvidence& evidence, const SensorTiming& timing, const ReadOrder& near, double range_s);

}  // namespace control
