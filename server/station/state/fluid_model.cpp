// The names of a model's parameters.
#include "server/station/state/fluid_model.hpp"

#include <fmt/format.h>

namespace server::station {

std::array<std::pair<std::string, float>, 2 * kFluidModelSections> parameters_of(const FluidModel& model) {
  std::array<std::pair<std::string, float>, 2 * kFluidModelSections> parameters;
  for (std::size_t i = 0; i < kFluidModelSections; ++i) {
    parameters[i] = {fmt::format("model_gain_{}_m_s", i + 1), model.gain_m_s[i]};
    parameters[kFluidModelSections + i] = {fmt::format("model_time_constant_{}_s", i + 1), model.time_constant_s[i]};
  }
  return parameters;
}

}  // namespace server::station
