#include "server/experiments/runner/pump_flow.hpp"

#include <fmt/format.h>

namespace server::experiments {
namespace {

std::string words_of(const std::string& pump, double mean_flow_m_s) {
  return pump == "off" ? pump : fmt::format("{}, mean {} m/s", pump, mean_flow_m_s);
}

}  // namespace

std::string flow_text(const Conditions& conditions) {
  return words_of(pump_flows()[static_cast<std::size_t>(conditions.pump)], conditions.mean_flow_m_s);
}

std::optional<std::string> flow_to_set(const Conditions& conditions,
                                       const std::optional<storage::RunConditions>& last) {
  const std::string needed = flow_text(conditions);
  const std::string now = last ? words_of(last->pump_profile, last->mean_flow_m_s.value_or(0)) : "off";
  if (needed == now) return std::nullopt;
  return fmt::format("set the pump to '{}' and resume; {} '{}'", needed,
                     last ? "this robot's last run was in" : "no run of this robot states a flow, so it counts as",
                     now);
}

}  // namespace server::experiments
