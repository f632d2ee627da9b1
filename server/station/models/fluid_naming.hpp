// What somebody has said of the fluid of a robot, and the model that belongs to it.
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
};

}  // namespace server::station
