// Finds the clock of an accelerometer from the readings and from what a model expects.
//
// Where the acceleration changes fast, each piece of ten readings tells their age s by the shift that fits best.
// Samples lie at A + P j, so exp(2πi (s - t)/P) has the same angle for all pieces: P is where these agree best, A the
// angle.  (1) Which sample a tick reads is then found from the costs of all orders near: squares of the residuals,
// limited; a sample read again must repeat the last reading, which a new one does now and then only. (2) Both are asked
// to stop between all steps: then there is no clock, and an order is the best so far. Errors: none thrown; none where
// no piece changes fast enough to tell.
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
