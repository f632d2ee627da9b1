// Finds the steps of a recorded experiment and measures each: new setpoints and injected disturbances, in auto mode.
//
// A step begins with the first sample that carries a new setpoint_m or disturbance_m, and ends with the next step, with
// auto mode, or with the recording's span. It starts from the position of its first sample. A step of less than 2 mm is
// left out: to hold is no step. So is one that a new setpoint ends within 1 s: setpoints that follow one another so
// fast are a path. The settling band is ±2 % of the latest step of setpoint, for disturbances too (as the paper's table
// reads).
// Where the position was measured from outside throughout a step, the step is measured by that (with the disturbance,
// which the robot's controller sees on top of it), and the robot's own position is compared with it. It then starts
// from where a line through the outside positions of the 200 ms before it passes at its first sample. Pure and slow for
// long runs: call it on a worker.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "control/responses/step_metrics.hpp"
#include "server/storage/runs/outside_reference.hpp"
#include "server/storage/samples/stored_sample.hpp"

namespace server::analysis {

inline constexpr double kSmallestStep_m = 0.002;  // from the position at which it begins

// What of a stored sample matters here.
struct StepPoint {
  std::uint32_t span = 0;
  std::uint64_t seq = 0;
  std::uint64_t robot_time_us = 0;
  float position_m = 0;
  float disturbance_m = 0;
  float setpoint_m = 0;
  bool steered = false;     // in auto mode with a setpoint
  float position_sd_m = 0;  // of an estimated position; 0: known; NaN: an estimate, not known how good
};

StepPoint step_point(const storage::StoredSample& stored);

// How far the robot's own position is from the one that was measured from outside.
struct EstimateError {
  double rms_m = 0;
  double worst_m = 0;      // the largest, in size
  double within_2_sd = 0;  // share of the positions at which it is no more than two standard deviations, of both
  std::size_t samples = 0;
};

enum class StepCause : std::uint8_t { setpoint, disturbance };
const char* text(StepCause value);

struct MeasuredStep {
  StepCause cause = StepCause::setpoint;
  std::uint32_t span = 0;
  std::uint64_t first_seq = 0;
  std::uint64_t last_seq = 0;
  double at_s = 0;  // since the first sample of the span
  double start_m = 0;
  double target_m = 0;
  double band_m = 0;
  double position_sd_m = 0;  // the largest in the step, start_m's and the zero's counted: every position in `metrics`
                             // is uncertain by ± 2 of it; NaN where it is anywhere
  bool is_from_outside = false;  // positions, metrics and position_sd_m are those of the outside reference
  std::optional<EstimateError> estimate_error;  // then
  control::StepMetrics metrics;
};

const char* position_source(const MeasuredStep& step);  // "outside", "estimate" or "known"

// Points in order of span and seq. A position that is not finite ends a step.
std::vector<MeasuredStep> measure_steps(const std::vector<StepPoint>& points,
                                        const storage::StoredReference* reference = nullptr);

// Over all of the reference; none where the two have no time in common.
std::optional<EstimateError> estimate_error(const std::vector<StepPoint>& points,
                                            const storage::StoredReference& reference);

// Steps by the outside reference where there is one, and how far the robot's own position was from it.
struct RunMeasures {
  std::vector<MeasuredStep> steps;
  std::optional<storage::OutsideReference> reference;
  std::optional<EstimateError> estimate_error;  // over all of the reference
};
RunMeasures measures_of(const std::vector<StepPoint>& points, const std::optional<storage::StoredReference>& reference);

}  // namespace server::analysis
