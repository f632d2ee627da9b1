// What a tuning found, and the map of what can be asked for, as JSON: for the command line and for jobs.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "control/tuning/tuning_map.hpp"
#include "server/analysis/control_json.hpp"

namespace server::analysis {

// What `rheonaut tune --json` prints, without the robustness table. It can be kept as a controller if it is feasible.
OrderedJson tuning_json(const control::FractionalModel& plant, const control::TuningSpec& spec,
                        const control::TuningResult& result, std::span<const control::PhaseMarginRange> sound_margins);

const char* text(control::MapReason value);
OrderedJson tuning_map_json(const control::FractionalModel& plant, const control::TuningMapSpec& spec,
                            std::span<const control::TuningMapPoint> map);

// The closed loop with this controller in one fluid: a step of 0.1 m, and a disturbance of -0.05 m after 20 s, as in
// the paper's Figure 7.
struct FluidPlant {
  std::string fluid;  // empty: the plant that was tuned for
  control::FractionalModel plant;
};
OrderedJson predicted_json(const FluidPlant& in, const control::Discretisation& controller, double duty_min,
                           double duty_max);

}  // namespace server::analysis
