// One method that was asked for, or the best of several.
#include "server/analysis/tuning/sampling.hpp"

#include <fmt/format.h>

#include <stdexcept>

namespace server::analysis {

control::DiscretisationChoice discretised(const control::FopdController& controller, const Sampling& sampling) {
  if (!sampling.method && !sampling.a) {
    return control::choose_discretisation(controller, sampling.period_s, sampling.order, sampling.bandwidth_rad_s);
  }
  control::DiscretisationOptions options;
  options.period_s = sampling.period_s;
  options.order = sampling.order;
  options.method = sampling.method.value_or(control::DiscretisationMethod::direct);
  options.a = sampling.a.value_or(options.a);
  options.loop_bandwidth_rad_s = sampling.bandwidth_rad_s;
  if (sampling.a && options.method != control::DiscretisationMethod::direct) {
    throw std::invalid_argument{fmt::format("a = {} belongs to the method direct; drop one of them", *sampling.a)};
  }
  const control::Discretisation made = control::discretise(controller, options);
  return {made, "as asked for", {made}, {}};
}

Sampling sampling_for(double period_s, bool is_one_way) {
  Sampling sampling;
  sampling.period_s = period_s;
  if (is_one_way) {
    sampling.method = control::DiscretisationMethod::direct;
    sampling.a = 0;
  }
  return sampling;
}

}  // namespace server::analysis
