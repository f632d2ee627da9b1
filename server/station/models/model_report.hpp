// What the station reports of the model of a robot's fluid: its state, and the reason in words.
//
// Pure functions; ModelSender publishes what they return.
#pragma once

#include <string>

#include "server/runtime/result.hpp"
#include "server/station/models/fluid_naming.hpp"
#include "server/station/state/station_state.hpp"

namespace server::station {

// Nobody has said that the robot's model is that of its fluid; `why` may be empty.
RobotModel assumed_model(std::string why);
// The same, after a confirmation was taken back, or when there is none to take back.
RobotModel unsent_model(const FluidModelList& models, const std::string& fluid);

// The model is on its way, or what was confirmed before is being taken back.
RobotModel model_on_its_way(const FluidNaming& naming);
RobotModel confirmed_model(const FluidNaming& naming);  // which has a model
// The robot holds it, and is as unsure as before: the model is in doubt.
RobotModel model_held_as_assumed(const FluidNaming& naming);
// Somebody has confirmed what the robot holds; the station knows no fluid of it.
RobotModel model_confirmed_by_command();
// The exchange with the robot has failed.
RobotModel failed_model(const FluidNaming& naming, const Error& error);
// A confirmation of unknown origin, before anything was sent.
RobotModel model_to_be_taken_back();

// The details of the events, for people.
std::string confirmed_words(const FluidNaming& naming);
std::string held_as_assumed_words(const FluidNaming& naming);
std::string taken_back_words(const FluidNaming& naming);
std::string not_sent_words(const FluidNaming& naming, const Error& error);

}  // namespace server::station
