// Identifies a motion model from a recorded run, and reports what the run does not determine.
//
//   y(t) = model(duty; kp, b1, b2, α, β) + offset,  b3 = 1              (1)   [birs2021] (20); one scale is redundant
//   least squares: Σ (y - model)²/σ_channel²                            (2)   output error
//   absolute error: Σ |y - model|                                       (3)   [birs2021] (21), read literally
//   0 < kp, b1, b2;  1 < α < 2;  0 < β < 1                              (4)   [birs2021] 3.2
//   covariance = σ² (JᵀJ)⁻¹ at the optimum of (2)                       (5)   Cramér-Rao: what no estimator can beat
//   covariance = τ² (JᵀJ)⁻¹ at the optimum of (3), τ = 1/(2 f(0))       (6)   [koenker-bassett]; f: density of
//   residuals
//
// Where the position is a robot's own estimate it contains the model that is built into the robot, and a fit would find
// that one: then the acceleration is fitted, with the sensor's bias, lag and clock as further unknowns
// (sensor_path.hpp).
//
// A position that was measured from outside has times of its own (position_time_s), and its clock may be off: then y of
// (1) is the model's position at those times plus a shift, which is a further unknown. Nothing that was measured is
// resampled, so sigmas count what was measured (position_times.hpp). Where its positions are not all as exact, each
// residual of (2) and (3) is divided by its own sd, relative to the others'; how large they are is found all the same.
//
// Structures: fractional (20); second_order, (19) with α = 2, β = 1; first_order, b1 = 0, β = 1. One is chosen by AIC.
// The search starts from the Newtonian model (28), as the paper does, and from further points against local minima.
// The simplest structure is searched first. Each search ends by its own counts of starts and iterations, so the same
// data and options give the same bits however busy the machine is. A time limit that is reached leaves no model:
// `best.end` is time_limit, and nothing else is set. The AIC of a search that was cancelled or reached its iteration
// limit is only an upper bound: such a fit can be the best, but is not taken to be worse than another, and a warning
// names it. Errors: throws std::invalid_argument quoting the bad value for data that cannot be used. Not having
// converged, having been cancelled, having run out of time or of finite numbers is a field of the result.
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "control/identification/identification.hpp"
#include "control/identification/planned_experiment.hpp"
#include "control/search/fit.hpp"

namespace control {

// From columns with times, which must be equally spaced within 1 % of a step. A few steps may be missing
// (missed_ticks.hpp).
Recording make_recording(std::span<const double> time_s, std::span<const double> duty,
                         std::span<const double> position_m, std::span<const double> velocity_m_s,
                         std::span<const double> acceleration_m_s2 = {});

// The result of a search that has reached its time limit: no model.
Identification out_of_time();

Identification identify(const Recording& recording, const IdentificationOptions& options);

// One model for several recordings of one robot in one fluid: each with its own offset, clock, sensor and noise, which
// are estimated beside the common model (joint_search.hpp). Of one recording it is identify(). In `best` the fit in
// percent, the residual's sd and the whiteness are those of all runs (joint_fit.hpp), and residuals are in `runs`.
// Warnings of one run only stand in it. kMostRecordings at most, kMostSamples in all.
inline constexpr std::size_t kMostRecordings = 8;
Identification identify_together(std::span<const Recording> recordings, const IdentificationOptions& options);

// How well a model follows a recording that it was not fitted to. Its parameters stay as they are, divided by b3;
// fitted are the position's offset, and of an acceleration the sensor's bias, lag and clock. The lag comes on top of
// the model's dead time: from half a period less, by which it is uncertain, to 6.5 periods more, which are the most
// that a fit without a dead time takes for the age of the readings. No parameter has a sigma. The options' structure
// and dead time are not looked at. Where the time limit is reached `end` is time_limit, and nothing else is set.
Fit evaluate(const FractionalModel& model, const Recording& recording, const IdentificationOptions& options = {});

}  // namespace control
