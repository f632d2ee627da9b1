// Parameters by the page that answers each command; controllers by their coefficients.
#include "server/station/read_back.hpp"

#include <algorithm>
#include <string_view>

namespace server {
namespace {

bool is_set_parameter(const protocol::Command& command) {
  return command.which_action == rheonaut_Command_set_parameter_tag;
}

bool is_ordered_by_one(SentCommands newer, const rheonaut_Parameter& parameter) {
  return std::ranges::any_of(newer, [&parameter](const protocol::Command* command) {
    const auto& order = command->action.set_parameter;
    return is_set_parameter(*command) && std::string_view{order.name} == parameter.name &&
           is_same(order.value, parameter.value);
  });
}

Sight sight_of(const protocol::Command& command, SentCommands newer, const protocol::ParameterPage& page) {
  if (page.command_id == 0 || page.command_id != command.command_id) return Sight::unseen;
  if (command.which_action == rheonaut_Command_get_parameters_tag) {
    const bool is_asked_for = page.first_index == command.action.get_parameters.first_index;
    return is_asked_for && page.parameters_count > 0 ? Sight::seen : Sight::missed;
  }
  if (!is_set_parameter(command)) return Sight::unseen;
  const auto& order = command.action.set_parameter;
  const auto* const end = page.parameters + page.parameters_count;
  const auto* const found = std::find_if(
      page.parameters, end, [&order](const auto& one) { return std::string_view{one.name} == order.name; });
  if (found == end) return Sight::missed;
  if (is_same(found->value, order.value)) return Sight::seen;
  return is_ordered_by_one(newer, *found) ? Sight::overtaken : Sight::missed;
}

Sight sight_of(const protocol::Command& command, const protocol::Controller& controller) {
  if (command.which_action == rheonaut_Command_restore_controller_tag) return Sight::seen;
  if (command.which_action != rheonaut_Command_set_controller_tag) return Sight::unseen;
  const protocol::Controller& wanted = command.action.set_controller;
  if (controller.controller_id != wanted.controller_id) return Sight::unseen;  // the one before it still is in force
  return is_same(controller, wanted) ? Sight::seen : Sight::missed;
}

}  // namespace

bool is_read_back(const protocol::Command& command) {
  switch (command.which_action) {
    case rheonaut_Command_set_parameter_tag:
    case rheonaut_Command_get_parameters_tag:
    case rheonaut_Command_set_controller_tag:
    case rheonaut_Command_restore_controller_tag: return true;
    default: return false;
  }
}

std::vector<Sight> read_back(SentCommands sent, const protocol::ParameterPage& page) {
  std::vector<Sight> sights;
  for (std::size_t i = 0; i < sent.size(); ++i) sights.push_back(sight_of(*sent[i], sent.subspan(i + 1), page));
  return sights;
}

std::vector<Sight> read_back(SentCommands sent, const protocol::Controller& controller) {
  std::vector<Sight> sights;
  for (const protocol::Command* command : sent) sights.push_back(sight_of(*command, controller));
  return sights;
}

}  // namespace server
