// The details of audit entries for acts that the station decides, as JSON; see AuditNote::detail.
#pragma once

#include <string>

#include "server/station/state/fluid_model.hpp"

namespace server::station {

// A request that was refused: what is known of it, as a JSON object, with the problem, and the reason if there is one.
// Of what somebody else says only the beginning is kept: it may be anything.
std::string refusal_detail(const std::string& request, const std::string& problem, const std::string& reason);

std::string control_detail(const std::string& cause, const std::string& holder);
std::string fluid_detail(const std::string& before);
// With the reason of who confirms it although it is in doubt.
std::string model_detail(const FluidModel& model);

// Requests, for refusal_detail(). `arguments`: a JSON object.
std::string refused_command(const std::string& kind, const std::string& arguments);
std::string refused_stop();
std::string refused_control(const std::string& action);
std::string refused_fluid(const std::string& fluid);
std::string refused_model(const std::string& fluid);

}  // namespace server::station
