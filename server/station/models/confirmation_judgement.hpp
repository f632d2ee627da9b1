// Judges, from what a robot reports, whether the confirmation of its model stands.
//
// A pure function, for a robot that nothing is sent to and whose telemetry has shown the flag. The flag may have fallen
// and risen between two samples, or while the robot was away; so parameters count beside it.
#pragma once

#include <optional>

#include "server/station/models/fluid_naming.hpp"
#include "server/station/models/observed_confirmation.hpp"
#include "server/station/state/in_force.hpp"

namespace server::station {

enum class Finding {
  nothing_new,
  taken_back,         // the robot has taken back what the station holds for confirmed
  model_of_fluid,     // confirmed, and the parameters are the model of the fluid that is named
  by_command,         // confirmed while the station watched, by somebody's command
  of_unknown_origin,  // SAFETY: confirmed, and nobody here knows for which fluid
};

struct Judgement {
  Finding finding = Finding::nothing_new;
  bool is_open = false;  // what belongs to it may still come: judge again
};

// `sent`: what was sent last, or found; none: nothing. `model`: of the fluid that is named; null: it has none.
Judgement judge(const RobotState& robot, const ObservedConfirmation& seen, const ParameterTable& reported,
                const std::optional<FluidModel>& sent, const FluidModel* model, std::int64_t now_us);

}  // namespace server::station
