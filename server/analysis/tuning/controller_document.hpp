// From the document of a controller that is kept to what a robot is sent.
//
// A document that a job `tune` made has the coefficients beside kp, kd and mu; any other gets them here.
#pragma once

#include <nlohmann/json.hpp>

#include "server/analysis/tuning/sampling.hpp"
#include "server/runtime/result.hpp"

namespace server::analysis {

// The member `discretised` of a controller's document: what discretise prints, with its reason.
OrderedJson discretised_json(const control::DiscretisationChoice& choice);

// The member `controller` of the command set_controller. `period_s` and `is_one_way` (a motor without reverse) are the
// robot's; they count where the document has no coefficients. invalid: the document holds no controller, its
// coefficients are those of another one, or it cannot be discretised. Takes up to 0.1 s.
Result<nlohmann::json> sections_of(const nlohmann::json& document, double period_s, bool is_one_way);

}  // namespace server::analysis
