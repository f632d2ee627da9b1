// One trial of the estimator: a robot in a fluid, its sensor, its motor, and what the estimate comes to.
//
// The duty comes by hand, or from the paper's controller, on the estimate or, `closed_loop` false, on the true
// position. With a mean flow U, the robot is in a tube without end in which sim_robot/world/pump makes the fluid
// pulsate.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "control/models/plant_models.hpp"
#include "robot_fw/core/estimator.hpp"
#include "robot_fw/core/safety.hpp"
#include "sim_robot/world/imu.hpp"

namespace robot_fw {

using DutyByHand = std::function<float(long tick)>;  // tick: from 1 on

struct EstimatorTrial {
  control::FractionalModel truth = control::kNonNewtonianModel;
  EstimatorParameters estimator{.is_confirmed = true};
  sim_robot::ImuParameters imu;
  double plant_gain = 1;      // of the truth
  double dead_zone_duty = 0;  // of the truth: below it the motor does not turn
  double mean_flow_m_s = 0;   // U
  double pump_on_at_s = -1;   // within 1 s; before 0 it was on all the time
  DutyRange duty{-1, 1};
  DutyByHand by_hand;
  bool closed_loop = false;
  double setpoint_m = 0.1;
  double second_setpoint_m = 0.1;  // from 20 s on
  double disturbance_m = 0;        // added to the measured position from 20 s on
  double duration_s = 42;
};

struct TrialResult {
  double estimate_error_m = 0;          // at the end
  double target_error_m = 0;            // true position less setpoint and disturbance's share, at the end
  double position_sd_m = 0;             // at the end
  double mismatch_s = -1;               // when first said; -1: never
  double share_within = 0;              // of all seconds, the estimate within 2 sd of the truth
  std::vector<double> errors_m, sds_m;  // of all seconds
  double flow_s = 0;                    // for so long a flow was suspected
};

TrialResult run_trial(const EstimatorTrial& trial, std::uint64_t seed);

// The paper's Figure 7 on the estimate, by a robot without a model of its fluid.
EstimatorTrial figure_7_in(const control::FractionalModel& fluid);
// Duties in [least, most], each held for 0.03 s to 1 s, for 30 s, then 0.
DutyByHand duties_at_random(float least, float most, std::uint64_t seed);
// Each second's share of trials, of seeds 1 to `seeds`, within 2 sd.
std::vector<double> shares_within(const EstimatorTrial& trial, int seeds);

// The 95th percentile of the absolute values, root mean square, share of trials within 2 sd at the end, and so on.
struct StudyRow {
  double error_95_m = 0, error_rms_m = 0, target_95_m = 0;
  double sd_m = 0;            // median
  double share_within = 0;    // of trials, at the end
  double seconds_within = 0;  // of trials and seconds
  int mismatches = 0;         // trials
  double mismatch_first_s = -1, mismatch_last_s = -1;
};

StudyRow run_study(const EstimatorTrial& trial, int seeds);

enum class Mismatch { never, always, allowed };  // always: within 5 s

struct Expectation {
  bool within_5_mm = true;  // 95 % of trials; in a closed loop also of the true position from the target
  Mismatch mismatch = Mismatch::never;
};

struct NamedTrial {
  const char* name;
  EstimatorTrial trial;
  Expectation expected;
};

// The cases of docs/robot.md, in its order.
std::vector<NamedTrial> study_trials();

}  // namespace robot_fw
