#include "server/station/models/parameter_match.hpp"

#include <algorithm>

namespace server::station {

bool holds(const ParameterTable& reported, const FluidModel& model) {
  return std::ranges::all_of(parameters_of(model), [&](const auto& parameter) {
    const std::optional<float> value = reported.value(parameter.first);
    return value && is_same(*value, parameter.second);
  });
}

bool holds_another(const ParameterTable& reported, const FluidModel& model) {
  return std::ranges::any_of(parameters_of(model), [&](const auto& parameter) {
    const std::optional<float> value = reported.value(parameter.first);
    return value && !is_same(*value, parameter.second);
  });
}

}  // namespace server::station
