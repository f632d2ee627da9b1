// What a search for a motion model takes and what it finds: the recording, the options, and a fit with its uncertainty.
//
// (1) to (6) are those of control/identification/identify.hpp, which says how they belong together.
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "control/models/plant_models.hpp"

namespace control {

enum class Structure { fractional, second_order, first_order };

// A step of a position of 1 m in binary32, 1.2e-7 m, over 12 samples of 10 ms: a record cannot tell a slower motion
// from rest, and a slower one that is computed from it is rounding.
inline constexpr double kSlowestMotionM_S = 1e-6;

// Uniformly sampled; duty[k] holds from sample k to sample k + 1. An empty channel was not recorded. Given are
// position, velocity or both, if they were measured; or the acceleration alone, as a robot records it
// (sensor_readings.hpp). Values are finite.
struct Recording {
  double dt_s = 0.01;
  std::vector<double> duty;
  std::vector<double> position_m;
  std::vector<double> velocity_m_s;
  std::vector<double> acceleration_m_s2 = {};
  // Of a position that was measured alone and not at the samples: seconds since the first sample, ascending, within the
  // record. Empty: position_m has one value per sample.
  std::vector<double> position_time_s = {};
  std::vector<double> position_sd_m = {};  // of each of them; empty: all alike
  // Ticks at which nothing was measured: duty and values are filled in (missed_ticks.hpp), and the fit leaves the
  // values out. Empty: none.
  std::vector<bool> is_missed = {};
  // Ticks that were measured and whose values the fit leaves out: the model is simulated through them with their duty.
  // Values of a position with times of its own are left out by the caller. Empty: none.
  std::vector<bool> is_left_out = {};
};

enum class Cost { least_squares, absolute_error };
enum class SearchEnd { converged, iteration_limit, time_limit, cancelled, not_finite };

inline constexpr std::size_t kMostSamples = 200000;  // of a recording and of a planned experiment

struct Progress {
  Structure structure = Structure::fractional;
  int start = 0, starts = 0;  // which of the multi-starts, from 0; before the first one there are none
  int iteration = 0;
  double sse = 0;
  bool is_for_dead_time = false;  // a further search of the same record: with a dead time that nobody named,
  bool is_for_dead_zone = false;  // or without the duties at which the motor stands still
};

// The names of options for the advice in a warning, as its reader gives them: "--dead-time-s". Empty: the reader cannot
// give the option, and no advice names it.
struct OptionNames {
  std::string dead_time, sensor_lag, offset, structure;
};

struct IdentificationOptions {
  std::optional<Structure> structure;  // none: all three, best by AIC
  Cost cost = Cost::least_squares;
  bool fits_offset = true;                           // the initial position is unknown, where position is recorded
  double longest_dead_time_s = 0;                    // 0: no dead time; else it is found in [0, this]
  bool tries_dead_time = false;                      // one is looked for where the record asks for it, if that is 0
  int further_starts = 4;                            // beside the paper's
  int iteration_limit = 200;                         // per start
  double time_limit_s = 300;                         // in all; what reaches it has no result
  std::function<bool(const Progress&)> on_progress;  // return false to cancel

  // The clock of a position with times of its own may be off. Not beside a dead time, which is the same to the model.
  bool fits_position_clock = true;

  // Of an accelerometer's readings, beyond their sampling and their low pass. What comes later than that is the plant's
  // dead time; the record alone cannot separate the two.
  std::optional<double> sensor_lag_s;

  OptionNames names;
};

inline constexpr std::size_t kParameters = 5;  // ln-scaled inside; reported as kp, b1, b2, alpha, beta
inline constexpr std::array<const char*, kParameters> kParameterNames{"kp", "b1", "b2", "alpha", "beta"};

// What a fit of the acceleration found of the sensor.
struct SensorFit {
  bool readings_are_recovered = false;  // the robot's own bias is off the record, and with it its model
  bool has_own_clock = false;           // else its samples keep step with the ticks
  double period_s = 0;                  // of its samples, by the robot's clock
  double clock_off = 0;                 // by how much that is longer than the robot's period, relative
  double time_constant_s = 0;           // of its low pass
  // Delay of a reading, in the mean, the low pass aside. The dead time of a model that identify() found is part of it;
  // that of a model given to evaluate() is not.
  double delay_s = 0;
  bool delay_is_at_limit = false;     // of what was searched
  double bias_m_s2 = 0;               // in the mean; of recovered readings but for a constant
  double bias_range_m_s2 = 0;         // how far it wandered
  std::size_t readings_left_out = 0;  // read twice, failed, of uncertain age, or of ticks that do not count
};

// Absent parameters (b1 of first order, the orders of integer structures) have no sigma and correlation 0.
struct Fit {
  Structure structure = Structure::fractional;
  FractionalModel model;  // b3 = 1; its dead time is 0 unless one was looked for
  double offset_m = 0;
  std::optional<double> offset_sigma_m, dead_time_sigma_s;
  double position_clock_s = 0;  // what the times of the position lack, with its sigma if it was fitted
  std::optional<double> position_clock_sigma_s;
  std::array<std::optional<double>, kParameters> one_sigma;
  std::array<std::array<double, kParameters>, kParameters> correlation{};
  double sse = 0;             // sum of squared residuals, of both channels in their own units
  double absolute_error = 0;  // (3) as an integral over time
  double fit_percent = 0;  // 100 (1 - |y - model|/|y - mean y|), of the first channel: position, velocity, acceleration
  double residual_sd = 0;  // of the same channel, over the values that count
  double aic = 0;          // Σ_channels n ln(sse/n) + 2 free_parameters; absolute error: 2 n ln(Σ|r|/n) for the sum
  int free_parameters = 0;  // of the model, and offset and dead time if they are fitted; the noise's sd is not counted
  bool residuals_are_white = false;
  double whiteness_p_value = 0;  // Ljung-Box, the smallest of the channels; white means at least 0.01
  // The largest of the channels, (8) of fit_statistics.hpp over 2 s and longer: by how much a slow drift makes sigmas
  // too small, which the whiteness at short lags does not show; 1: none is seen.
  double drift_factor = 1;
  // The largest of the channels, √(n/n_effective) of (7) there: by how much residuals that are not white make sigmas
  // too small.
  double colour_factor = 1;
  std::optional<double> position_whiteness_p_value, velocity_whiteness_p_value, acceleration_whiteness_p_value;
  SearchEnd end = SearchEnd::converged;
  // iterations: of the best start; starts: made, 0 if the structure was never searched; agree: with the best cost
  int iterations = 0, starts = 0, starts_that_agree = 0;
  // Measured less model, empty if not recorded. Of positions with sds of their own: weighed by (1) of
  // position_weight.hpp, as in sse and what follows from it.
  std::vector<double> position_residual_m, velocity_residual_m_s;
  std::vector<double> acceleration_residual_m_s2;  // less the bias too; 0 for readings left out
  std::optional<SensorFit> sensor;                 // of a fit of the acceleration
};

// A score test's answer to what further parameters would explain: ones that change with amplitude
// or another linear model (score_doubts.hpp), or parameters of each run's own (joint_fit.hpp).
struct ScoreEvidence {
  double share = 0;     // of the squares of the residuals, that they explain
  double f = 0;         // about 1 where nothing changes
  double widening = 1;  // (1) of doubts.hpp
};

}  // namespace control
