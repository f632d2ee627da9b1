// How certain the margin of a tuning is, by the sigmas of the fit that its plant is from.
#pragma once

#include <optional>

#include "control/tuning/margin_uncertainty.hpp"
#include "control/tuning/tune.hpp"
#include "server/analysis/control_json.hpp"

namespace server::analysis {

using PlantUncertainty = std::optional<control::ExpectedUncertainty>;  // none: not known

// None: the sigmas of its plant are not known, or the loop has no gain crossover.
std::optional<control::MarginUncertainty> margin_sigmas(const control::OpenLoop& loop, const control::Margins& margins,
                                                        const PlantUncertainty& of_plant);
// None also: no controller was found.
std::optional<control::MarginUncertainty> margin_sigmas(const control::FractionalModel& plant,
                                                        const control::TuningResult& result,
                                                        const PlantUncertainty& of_plant);

// Adds `phase_margin_sigma_deg`, `crossover_sigma_rad_s` and `phase_slope_sigma_deg_per_rad_s` to margins, null where
// not known.
void add_margin_sigmas(const std::optional<control::MarginUncertainty>& sigmas, OrderedJson& margins);
// The same to `achieved` of a tuning's answer.
void add_margin_sigmas(const control::FractionalModel& plant, const control::TuningResult& result,
                       const PlantUncertainty& of_plant, OrderedJson& answer);
// Adds `plant_doubts`, null where they are not known, and `plant_doubts_text`, a line for people.
void add_plant_doubts(const ModelDoubts& known, OrderedJson& answer);

}  // namespace server::analysis
