// Compares the parameters that a robot has reported with the model of a fluid, bit for bit.
#pragma once

#include "server/station/state/fluid_model.hpp"
#include "server/station/state/in_force.hpp"

namespace server::station {

// The parameter that confirms the other eight.
inline constexpr const char* kModelConfirmed = "model_confirmed";
// How far the eight may be off, while nobody confirms them.
inline constexpr const char* kModelSectionError = "model_section_error";

// All eight have been reported, and are the model's.
bool holds(const ParameterTable& reported, const FluidModel& model);
// At least one has been reported that is not the model's.
bool holds_another(const ParameterTable& reported, const FluidModel& model);

}  // namespace server::station
