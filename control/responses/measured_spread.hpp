// The spread of the position that a robot measures, in a loop that acts on it, around the position predicted for it.
//
// The measured position is the robot's own estimate, x̂ = x + e_x: what telemetry says and the controller sees, without
// the disturbance. To first order around the prediction, tick by tick:
//   δx̂ = δx + e_x,  δu = -C(z) δx̂, or 0 where the duty is given or clipped                                     (1)
//   δx' = Σ g_i δy_i, the plant's sections driven by δu                                                         (2)
//   e as in (2) and (3) of estimator_covariance.hpp, by its gains                                               (3)
//   ε = floor f_1 + shape |v_m| f_2:  f of sd 1 that keep their sign for correlation_s and 0.1 s                  (4)
//   s = (e, δy, δx, δu, f, states of C):  P → A P Aᵀ + Q, for each source by itself                               (5)
// So the loop holds x̂, and the true position, x = x̂ - e_x, drifts with the estimate's error: its spread, of these
// sources, is true_m.
//
// Sources, each an sd in m, independent of each other:
//   estimator  the model in the robot's estimator. A confirmed one is off by model_error, relative; an assumed one by
//              what the robot states: its gains, its shape, and a floor.
//   sensor     noise of the readings and walk of the bias, as the robot's parameters state; age of the readings, 4 ms
//              (sd, low pass included); readings skipped or repeated by the sensor's own clock (sensor_prior.hpp)
//   start      velocity and bias, as well as the estimator knows them after 3 s at rest, the position just zeroed.
//              A velocity that the fluid remembers from before is within that of the velocity.
// Not in it: the error of the plant's parameters (server/experiments/preview_band), flow, and what no model describes.
// Errors: throws std::invalid_argument where the motion's columns differ in length.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "control/responses/estimator_covariance.hpp"
#include "control/responses/sections.hpp"

namespace control {

enum class LoopTick : std::uint8_t { duty_given, clipped, acts };  // manual; auto at a limit of the duty; auto

// As predicted, a value for each tick: the duty from it on, the velocity at it.
struct LoopMotion {
  std::vector<double> duty, velocity_m_s;
  std::vector<LoopTick> ticks;
};

struct LoopParts {
  EstimateParameters estimate;
  double model_error = 0;  // of a confirmed model: the largest of its step response, relative to the final velocity
  std::array<double, kEstimateSections> gain_m_s{}, time_constant_s{1, 1, 1, 1};  // (2)
  ParallelSections controller;
};

struct MeasuredSpread {
  std::vector<double> estimator_m, sensor_m, start_m;  // of the measured position
  std::vector<double> true_m;                          // of the true one
};

MeasuredSpread measured_spread(const LoopMotion& motion, const LoopParts& parts);

}  // namespace control
