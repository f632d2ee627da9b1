// How certain the margin of a tuning is, by the sigmas of the fit that its plant is from.
#pragma once

#include <optional>

#include "control/tuning/margin_uncertainty.hpp"
#include "control/tuning/tune.hpp"
#include "server/analysis/control_json.hpp"

namespace server::analysis {

using PlantUncertainty = std::optional<control::ExpectedUncertainty>;  // none: not known

// None: no controller was found, or the sigmas of its plant are not known.
std::optional<control::MarginUncertainty> margin_sigmas(const control::FractionalModel& plant,
                                                        const control::TuningResult& result,
                                                        const PlantUncertainty& of_plant);

// Adds `phase_margin_sigma_deg` and `crossover_sigma_rad_s` to `achieved` of a tuning's answer, null where not known.
void add_margin_sigmas(const control::FractionalModel& plant, const control::TuningResult& result,
                       const PlantUncertainty& of_plant, OrderedJson& answer);
// Adds `plant_doubts`, null where they are not known, and `plant_doubts_text`, a line for people.
void add_plant_doubts(const ModelDoubts& known, OrderedJson& answer);

}  // namespace server::analysis
