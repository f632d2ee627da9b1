#include "server/station/models/model_report.hpp"

#include <fmt/format.h>

#include <utility>

namespace server::station {
namespace {

constexpr const char* kNotTakenBack = "what was confirmed before is not taken back yet";

RobotModel model_in(ModelState state, std::string reason) {
  RobotModel model;
  model.state = state;
  model.reason = std::move(reason);
  return model;
}

void add_fluid(RobotModel& into, const std::string& fluid, const FluidModel& model) {
  into.fluid = fluid;
  into.fit_error = model.fit_error;
  into.set_at_us = model.set_at_us;
}

std::string which(const FluidNaming& naming) {
  return (naming.own_beside_us ? "its own model of " : "") + naming.fluid;
}

}  // namespace

RobotModel assumed_model(std::string why) { return model_in(ModelState::assumed, std::move(why)); }

RobotModel unsent_model(const FluidModelList& models, const std::string& fluid) {
  if (models.find(fluid) != nullptr) return assumed_model("name the fluid again to send its model");
  return assumed_model(fluid.empty() ? "" : fmt::format("there is no model of '{}'", fluid));
}

RobotModel model_on_its_way(const FluidNaming& naming) {
  RobotModel model = model_in(ModelState::sending, naming.model ? "" : "what was confirmed before is taken back");
  if (naming.model) add_fluid(model, naming.fluid, *naming.model);
  return model;
}

RobotModel confirmed_model(const FluidNaming& naming) {
  RobotModel confirmed = model_in(ModelState::confirmed, naming.own_beside_us ? "sent to this robot alone" : "");
  add_fluid(confirmed, naming.fluid, *naming.model);
  return confirmed;
}

RobotModel model_held_as_assumed(const FluidNaming& naming) {
  RobotModel held =
      assumed_model(fmt::format("sent as assumed only, since it is in doubt: {}", naming.model->assumed_because));
  add_fluid(held, naming.fluid, *naming.model);
  return held;
}

RobotModel model_confirmed_by_command() { return model_in(ModelState::confirmed, "by a command, and of no fluid"); }

RobotModel failed_model(const FluidNaming& naming, const Error& error) {
  if (!naming.model) return model_in(ModelState::failed, fmt::format("{}: {}", kNotTakenBack, error.detail));
  RobotModel failed =
      model_in(ModelState::failed, error.detail + (naming.own_beside_us ? "; then send the model again" : ""));
  add_fluid(failed, naming.fluid, *naming.model);
  return failed;
}

RobotModel model_to_be_taken_back() { return model_in(ModelState::failed, kNotTakenBack); }

std::string confirmed_words(const FluidNaming& naming) {
  return fmt::format("{} by {}", which(naming), naming.by.actor);
}

std::string held_as_assumed_words(const FluidNaming& naming) {
  return fmt::format("{}, as assumed only: {}", confirmed_words(naming), naming.model->assumed_because);
}

std::string taken_back_words(const FluidNaming& naming) {
  if (naming.fluid.empty()) return "the robot is in a fluid that is not known";
  return fmt::format("the robot is in '{}'", naming.fluid);
}

std::string not_sent_words(const FluidNaming& naming, const Error& error) {
  if (naming.own_beside_us) return fmt::format("{} could not be sent: {}", which(naming), error.detail);
  return fmt::format("the model of '{}' could not be sent: {}", naming.fluid, error.detail);
}

}  // namespace server::station
