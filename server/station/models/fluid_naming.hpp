// The fluid that somebody has named for a robot, and the model that the robot is to have for it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "server/station/state/audit_note.hpp"
#include "server/station/state/fluid_model.hpp"
#include "server/station/state/station_state.hpp"

namespace server::station {

struct FluidNaming {
  std::uint64_t number = 0;  // counts those of this robot
  Author by;
  BootId boot_id = 0;
  std::string fluid;                // empty: not known
  std::optional<FluidModel> model;  // none: a confirmation is taken back
  // An own model: one that was sent to this robot alone. When the fluid's model of the list was set, at that time; 0:
  // there was none. Nothing: the model is of the list.
  std::optional<std::int64_t> own_beside_us{};
};

}  // namespace server::station
