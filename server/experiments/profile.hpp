// An experiment profile: what a robot is to do, in which conditions, and when to abort. Plain values.
//
// profile_document.hpp reads it. Positions are in the robot's own coordinates, duties in -1 to 1.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/fields.hpp"

namespace server::experiments {

inline constexpr double kTick_s = 0.01;  // of the robot
inline constexpr std::size_t kMostSteps = 200, kMostRuns = 1000;

// In the order of step_kinds(). Up to multisine the duty is given (manual), then the robot controls its position
// (auto).
enum class StepKind : std::uint8_t {
  rest,
  duty,
  staircase,
  ramp,
  chirp,
  prbs,
  multisine,
  setpoint,
  disturbance,
  scan,
  tones
};
std::span<const char* const> step_kinds();
inline bool is_closed_loop(StepKind kind) { return kind >= StepKind::setpoint; }
inline bool has_setpoint(StepKind kind) { return is_closed_loop(kind) && kind != StepKind::disturbance; }

struct Step {
  StepKind kind = StepKind::rest;
  double for_s = base::kMustBeGiven;
  double duty = base::kMustBeGiven;
  double from_duty = base::kMustBeGiven, to_duty = base::kMustBeGiven;
  std::uint64_t levels = 5;               // of a staircase, both ends included
  double amplitude = base::kMustBeGiven;  // of chirp, prbs and multisine, about mean_duty
  double mean_duty = 0;
  double from_hz = base::kMustBeGiven, to_hz = base::kMustBeGiven;
  std::uint64_t tones = 8;            // of a multisine
  double bit_s = base::kMustBeGiven;  // of a prbs
  double every_s = 0.05;              // a changing duty, or setpoint of a scan, holds for so long
  double setpoint_m = base::kMustBeGiven;
  double disturbance_m = base::kMustBeGiven;
  double velocity_m_s = base::kMustBeGiven;  // of a scan
  double amplitude_m = base::kMustBeGiven;   // of each of the three tones
  double crossover_rad_s = base::kMustBeGiven;
};

enum class PumpFlow : std::uint8_t { off, constant, pulse_70_bpm };
std::span<const char* const> pump_flows();

// Where the position counts from, and where each run begins.
enum class StartPosition : std::uint8_t { zero, here, back };
std::span<const char* const> start_positions();

struct Conditions {
  std::string fluid;  // empty: the one that the robot is in
  PumpFlow pump = PumpFlow::off;
  double mean_flow_m_s = 0;
  StartPosition start = StartPosition::zero;
};

// The limits of what a profile may ask for, checked when it is read; the limits of the station hold as well.
struct ProfileLimits {
  double position_min_m = -1, position_max_m = 1;
  double duty_max = 1;  // magnitude
  double duration_max_s = 600;
};

// Any of them ends a run. SAFETY: a position counts with two standard deviations, since it is an estimate.
struct AbortCriteria {
  double position_min_m = -100, position_max_m = 100;
  double position_sd_max_m = 10;
  double power_s = 60;         // at a duty beyond 0.9
  double gap_s = 1;            // without a sample: it is interrupted
  double missing_share = 0.1;  // of the samples of the last 10 s
  bool sensor_fault = true;
};

// Each list is an axis of a grid; an empty one leaves the axis out.
struct Sweep {
  std::vector<double> duty_factor, setpoint_factor;
  std::vector<std::string> fluids, controllers;
  std::uint64_t repeats = 1;
};

// The experiment goes on until a parameter of the robot's model is known so well.
struct Until {
  std::size_t parameter = 0;  // index of control::kParameterNames
  double sigma = 0;           // one sigma of it, at most
};

inline constexpr std::uint64_t kMostRunsUntilKnown = 8;  // that one fit takes

struct Profile {
  std::string name, purpose;
  Conditions conditions;
  ProfileLimits limits;
  AbortCriteria abort;
  // SAFETY: of a profile in which all steps are closed-loop: it may go on while nobody is there, for the robot's
  // auto_limit_s at most, where the station's configuration allows it.
  bool is_unattended = false;
  // If given, the steps are a choice: each run performs one of them, with one of the sweep's duty factors.
  std::optional<Until> until;
  std::uint64_t most_runs = kMostRunsUntilKnown;  // with until
  std::vector<Step> steps;
  Sweep sweep;
};

// One run of the grid.
struct Variant {
  std::string fluid{}, controller{};  // empty: the fluid that the robot is in, and the controller in force
  double duty_factor = 1, setpoint_factor = 1;
  std::uint64_t repeat = 1;
  std::size_t step = 0;  // from 1, the only one that it performs; 0: all of them
};
// All of them; repeats of one combination follow each other. With until: what each run may be.
std::vector<Variant> variants_of(const Profile& profile);

std::string text(const Until& until);  // "sigma(alpha) <= 0.02"

// What the run performs: the steps of the profile, or the only one of them.
Profile profile_of_run(const Profile& profile, const Variant& variant);

}  // namespace server::experiments
