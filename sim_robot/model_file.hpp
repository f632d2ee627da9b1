// Reads a model that the station's tools identified or printed, as JSON.
//
//   {"kp":0.1,"b1":0.005682,"b2":0.11031,"b3":1,"alpha":1.7263,"beta":0.8682}        a model file; b3 is 1 if left out
//   {"parameters":{…},…}                                                             `rheonaut identify --json`
//   {"model":{…},…}                                                                  `hydrodynamic` of `rheonaut model
//   --json`
// See docs/commands.md. Keys of a model that say something else about it are passed over.
// Errors: throws std::invalid_argument that says what is wrong, which value it has, and what is allowed.
#pragma once

#include <string>

#include "control/plant_models.hpp"

namespace sim_robot {

control::FractionalModel parse_model(const std::string& json);
control::FractionalModel load_model(const std::string& path);

}  // namespace sim_robot
