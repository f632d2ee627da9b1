// How a robot comes into each state of docs/robot.md, and how each of its commands and events is made.
#pragma once

#include <ostream>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "robot_fw/core/mode_table.hpp"
#include "sim_robot/lab/station_peer.hpp"
#include "tests/robot_fw/bare_core.hpp"
#include "tests/robot_fw/mode_page.hpp"

namespace robot_fw {

using ParameterValues = std::vector<std::pair<const char*, float>>;

constexpr float kManualDuty = 0.3F, kScheduleDuty = 0.2F;
constexpr float kLimitM = 0.1F;  // of the position, on both sides

struct StateCase {
  const char* name;
  const char* state;  // its word on the page
  void (*enter)(BareCore&);
  protocol::ResetCause reset_cause = rheonaut_RESET_CAUSE_POWER_ON;
};
inline void PrintTo(const StateCase& each, std::ostream* out) { *out << each.name; }

struct CommandCase {
  const char* name;  // its row on the page
  protocol::Command (*command)(const BareCore&);
};

struct EventCase {
  const char* name;
  ParameterValues parameters;
  void (*happen)(BareCore&);
};

extern const std::vector<StateCase> kStateCases;
extern const std::vector<CommandCase> kCommandCases;
extern const std::vector<EventCase> kEventCases;

// A robot that has come into the state, with these parameters.
BareCore prepared(const StateCase& state, const ParameterValues& parameters);

// Whether the word of a cell is a reason of refusal.
bool is_reason(const std::string& cell);

inline std::set<std::string> names_of(const PageTable& table) {
  std::set<std::string> names;
  for (const auto& [name, row] : table) names.insert(name);
  return names;
}
template <typename Case>
std::set<std::string> names_of(const std::vector<Case>& cases) {
  std::set<std::string> names;
  for (const Case& each : cases) names.insert(each.name);
  return names;
}

}  // namespace robot_fw
