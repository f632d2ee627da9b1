// Parameters by the page that answers each command; controllers by what each command makes of the two that a robot has.
#include "server/station/commands/read_back.hpp"

#include <algorithm>
#include <string_view>
#include <utility>

namespace server::station {
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

bool is_restore(const protocol::Command& command) {
  return command.which_action == rheonaut_Command_restore_controller_tag;
}

bool changes_controller(const protocol::Command& command) {
  return is_restore(command) || command.which_action == rheonaut_Command_set_controller_tag;
}

// What a robot runs, and what its restore_controller swaps it with; none: not known.
struct Controllers {
  std::optional<protocol::Controller> newest, former;
};

bool is_newest(const Controllers& controllers, const protocol::Controller& one) {
  return controllers.newest && is_same(*controllers.newest, one);
}

// After each of the commands. In auto a controller comes into force 1 s after its command, and a second command within
// that second takes the place of the first; at rest the first is what the second leaves behind.
std::vector<Controllers> after_each(SentCommands sent, const RobotSettings& known) {
  Controllers now;
  if (known.is_controller_current) now = {known.controller, known.controller_before};
  bool may_be_waiting = false;
  std::vector<Controllers> all;
  for (const protocol::Command* command : sent) {
    if (is_restore(*command)) {
      std::swap(now.newest, now.former);
    } else if (changes_controller(*command)) {
      now = {command->action.set_controller, may_be_waiting ? std::nullopt : now.newest};
    }
    may_be_waiting = may_be_waiting || changes_controller(*command);
    all.push_back(now);
  }
  return all;
}

// The newest command that has brought the controller that is reported.
std::optional<std::size_t> bringer(SentCommands sent, const std::vector<Controllers>& after, const RobotSettings& known,
                                   const protocol::Controller& reported) {
  for (std::size_t i = sent.size(); i-- > 0;) {
    if (changes_controller(*sent[i]) && is_newest(after[i], reported)) return i;
  }
  if (!known.is_controller_current) return std::nullopt;  // the report after Welcome, which no command has brought
  for (std::size_t i = sent.size(); i-- > 0;) {
    if (is_restore(*sent[i]) && !after[i].newest) return i;
  }
  return std::nullopt;
}

// Of a controller that none of the commands has brought.
Sight sight_of_another(const protocol::Command& command, const RobotSettings& known,
                       const protocol::Controller& reported) {
  const bool is_still_the_same = !known.is_controller_current || is_same(*known.controller, reported);
  if (is_still_the_same || !changes_controller(command)) return Sight::unseen;
  const bool is_its_own = is_restore(command) || command.action.set_controller.controller_id == reported.controller_id;
  return is_its_own ? Sight::missed : Sight::unseen;
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
  sights.reserve(sent.size());
  for (std::size_t i = 0; i < sent.size(); ++i) sights.push_back(sight_of(*sent[i], sent.subspan(i + 1), page));
  return sights;
}

ControllerReading read_back(SentCommands sent, const RobotSettings& known, const protocol::Controller& reported) {
  const std::vector<Controllers> after = after_each(sent, known);
  const std::optional<std::size_t> brought_by = bringer(sent, after, known, reported);
  ControllerReading reading;
  for (std::size_t i = 0; i < sent.size(); ++i) {
    if (!brought_by) {
      reading.sights.push_back(sight_of_another(*sent[i], known, reported));
    } else if (i > *brought_by || !changes_controller(*sent[i])) {
      reading.sights.push_back(Sight::unseen);
    } else {
      const bool is_seen = i == *brought_by || is_newest(after[i], reported);
      reading.sights.push_back(is_seen ? Sight::seen : Sight::overtaken);
    }
  }
  const bool is_unexplained_change =
      known.is_controller_current && !is_same(*known.controller, reported) &&
      std::ranges::none_of(sent, [](const auto* command) { return changes_controller(*command); });
  if (brought_by) {
    reading.former = after[*brought_by].former;
  } else if (is_unexplained_change) {
    reading.former = known.controller;
  }
  return reading;
}

}  // namespace server::station
