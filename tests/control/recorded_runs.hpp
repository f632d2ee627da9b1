// Makes runs of known models, with and without noise, for the tests of identification.
#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "control/identification/identify.hpp"
#include "control/models/modal_form.hpp"
#include "control/search/output_model.hpp"

namespace control {

// A search that ends by itself, however busy the machine is.
inline IdentificationOptions unhurried_options() {
  IdentificationOptions options;
  options.time_limit_s = 1e6;
  return options;
}

inline std::vector<double> output_of(const FractionalModel& model, Channel channel, double dt_s,
                                     const std::vector<double>& duty, double dead_time_s = 0) {
  OutputModel output(channel, dt_s, duty, dead_time_s, 1e-13);
  output.set_delay(dead_time_s);
  const Eigen::VectorXd values = output.output(model);
  return {values.begin(), values.end()};
}

inline void add_noise(std::vector<double>& values, double sd, unsigned seed) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> noise(0, sd);
  for (double& value : values) value += noise(generator);
}

inline Recording position_run(const FractionalModel& model, const std::vector<double>& duty, double sd, unsigned seed) {
  Recording recording{0.01, duty, output_of(model, Channel::position, 0.01, duty), {}};
  add_noise(recording.position_m, sd, seed);
  return recording;
}

// The response to a step by the modal form of the model itself, which identification does not use.
inline std::vector<double> step_response(const FractionalModel& model, Channel channel, double duty, double dt_s,
                                         std::size_t samples) {
  const ModalForm form = modal_form(model, {dt_s, dt_s * static_cast<double>(samples), 1e-14});
  std::vector<double> response(samples);
  for (std::size_t k = 1; k < samples; ++k) {
    const double t_s = dt_s * static_cast<double>(k);
    for (std::size_t i = 0; i < form.rate.size(); ++i) {
      const Complex s = form.rate[i], z = s * t_s;
      const bool is_small = std::abs(z) < 1e-3;  // the series avoids differences of nearly equal numbers
      const Complex once = is_small ? z + z * z / 2.0 + z * z * z / 6.0 + z * z * z * z / 24.0 : std::exp(z) - 1.0;
      const Complex twice = is_small ? z * z / 2.0 + z * z * z / 6.0 + z * z * z * z / 24.0 : once - z;
      response[k] += duty * 2 * (form.weight[i] * (channel == Channel::velocity ? once / s : twice / (s * s))).real();
    }
  }
  return response;
}

}  // namespace control
