// The open loop of a position or velocity control: a plant with its controller.
#pragma once

#include "control/models/transfer_function.hpp"

namespace control {

struct OpenLoop {
  FractionalModel plant;
  FopdController controller;
  bool is_velocity_loop = false;
};

}  // namespace control
