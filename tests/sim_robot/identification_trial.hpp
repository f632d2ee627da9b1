// One trial of identification: a simulated robot with the default sensor in a fluid, its telemetry, and what the fit of
// its acceleration comes to.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "control/identification/identify.hpp"
#include "sim_robot/world/plant.hpp"

namespace sim_robot {

struct IdentificationTrial {
  control::FractionalModel fluid;
  bool believes_in_water = false;      // the model that is built into the robot: else that of (29)
  std::vector<double> duty = {};       // a value for each tick
  double dead_time_s = 0;              // of the fluid
  PlantKind kind = PlantKind::linear;  // else another takes the fluid's place
};

// The fluids of the study: none is (29), which is what the robot believes in.
inline constexpr std::array<control::FractionalModel, 5> kStudyFluids{{
    {0.1, 0.0045, 0.15, 1, 1.75, 0.85},
    {0.08, 0.0035, 0.07, 1, 1.6, 0.75},
    {0.13, 0.009, 0.16, 1, 1.9, 0.95},
    {0.1, 0.0034, 0.1765, 1, 1.5, 0.65},
    {0.09, 0.0085, 0.066, 1, 1.85, 0.7},
}};

// Fractional, from the first start alone, and without an end in time: a busy machine fits the same.
control::IdentificationOptions one_start_options();

// ±0.6 in bits of 0.5 s for 60 s.
std::vector<double> study_duty();

// What the station records of the trial: the duty as it was driven, and the acceleration.
control::Recording record(const IdentificationTrial& trial, std::uint64_t seed);

// What the station records of a scenario's script, in another fluid if one is given: as `rheonaut-sim play FILE
// --seed`.
control::Recording record_played(const std::string& file, std::uint64_t seed,
                                 const std::optional<control::FractionalModel>& fluid = std::nullopt);

// The same with the true position and a measuring device's white noise, and no robot.
control::Recording record_position(const IdentificationTrial& trial, double sd_m, std::uint64_t seed);

// Steps of 5 s at duty 0.2, 0.5 and 0.8 with 5 s of rest behind each; and one of ±0.2, ±0.5, ±0.8 every 0.5 s for 60 s.
std::vector<double> steps_duty();
std::vector<double> levels_duty(std::uint64_t seed);

struct TrialFit {
  control::Fit fit;
  double worst_response = 0;        // relative error of the velocity after a step, at 0.1, 1 and 5 s
  double worst_sigmas = 0;          // of the parameters' errors, in their own sigmas
  double worst_sigma_by_bound = 0;  // of the sigmas, by the Cramér-Rao bound of the true fluid and the true noise
};

// The structure is taken as known, the search begins at the paper's start alone.
TrialFit fit_of(const control::Recording& recording, const control::FractionalModel& fluid);

// Of one model's velocity after a step to another's, the worst at 0.1, 1 and 5 s.
double worst_response_error(const control::FractionalModel& model, const control::FractionalModel& truth);

}  // namespace sim_robot
