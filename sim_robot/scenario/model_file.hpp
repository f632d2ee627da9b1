// Reads a model that the station's tools identified or printed, as JSON.
//
//   {"kp":0.1,"b1":0.005682,"b2":0.11031,"b3":1,"alpha":1.7263,"beta":0.8682}        a model file; b3 is 1 if left out,
//   dead_time_s 0
//   {"parameters":{…},"dead_time_s":0.03,…}                                          `rheonaut identify --json`
//   {"model":{…},…}                                                                  `hydrodynamic` of `rheonaut model
//   --json`
// See docs/commands.md. A `dead_time_s` may stand in the model and beside it. Other keys of a model are
// ignored. Errors: throws std::invalid_argument that says what is wrong, which value it has, and what
// is allowed.
#pragma once

#include <string>

#include "sim_robot/world/plant.hpp"

namespace sim_robot {

PlantParameters parse_model(const std::string& json);
PlantParameters load_model(const std::string& path);

}  // namespace sim_robot
