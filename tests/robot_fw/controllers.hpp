// Controllers as a station sends them, for tests: those of the golden frames, and changed ones with their checksum.
#pragma once

#include "robot_fw/core/controller_message.hpp"
#include "tests/protocol/golden_controllers.hpp"

namespace robot_fw {

using protocol::biquad_controller;
using protocol::paper_controller;
using protocol::set_column;

inline protocol::Controller with_checksum(protocol::Controller controller) {
  controller.checksum = checksum_of(controller);
  return controller;
}

// The paper's with another gain, so that every duty shows which of the two drives.
inline protocol::Controller scaled_controller(std::uint32_t id, float factor) {
  protocol::Controller controller = paper_controller();
  controller.controller_id = id;
  controller.kp *= factor;
  controller.direct *= factor;
  for (float& residue : controller.residue) residue *= factor;
  return with_checksum(controller);
}

}  // namespace robot_fw
