// A model of water, and a table of parameters as a robot reports it.
#pragma once

#include <cstring>
#include <map>
#include <string>

#include "server/station/state/fluid_model.hpp"
#include "server/station/state/in_force.hpp"

namespace server {

inline station::FluidModel some_model(float first_gain = 0.25F) {
  station::FluidModel model;
  model.gain_m_s = {first_gain, -0.5F, 0.1F, 0};
  model.time_constant_s = {0.1F, 1, 5, 15};
  model.fit_error = 0.002;
  model.set_by = "token:local";
  model.set_at_us = 1'700'000'000'000'000;
  return model;
}

inline std::map<std::string, float> values_of(const station::FluidModel& model) {
  const auto parameters = parameters_of(model);
  return {parameters.begin(), parameters.end()};
}

inline void report(station::ParameterTable& table, const std::string& name, float value) {
  protocol::ParameterPage page = rheonaut_ParameterPage_init_zero;
  page.total = 9;
  page.parameters_count = 1;
  std::strncpy(page.parameters[0].name, name.c_str(), sizeof page.parameters[0].name - 1);
  page.parameters[0].value = value;
  table.add(page);
}

inline station::ParameterTable table_of(const std::map<std::string, float>& values) {
  station::ParameterTable table;
  for (const auto& [name, value] : values) report(table, name, value);
  return table;
}

}  // namespace server
