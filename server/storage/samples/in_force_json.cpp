#include "server/storage/samples/in_force_json.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/json_text.hpp"

namespace server::storage {
using base::decimal;
using nlohmann::json;

namespace {

json parameters_json(const station::ReportedParameters& parameters) {
  json table = json::object();
  for (const auto& [name, parameter] : parameters) {
    table[name] = {{"value", decimal(parameter.value)},
                   {"unit", parameter.unit},
                   {"minimum", decimal(parameter.minimum)},
                   {"maximum", decimal(parameter.maximum)},
                   {"default", decimal(parameter.default_value)}};
  }
  return table;
}

template <std::size_t size>
json numbers(const float (&values)[size], std::size_t count) {
  json list = json::array();
  for (std::size_t i = 0; i < std::min(count, size); ++i) list.push_back(decimal(values[i]));
  return list;
}

}  // namespace

const char* kind_of(const station::InForceContent& content) {
  return std::holds_alternative<station::ReportedParameters>(content) ? "parameters" : "controller";
}

std::string document_text(const station::InForceContent& content) {
  const auto* parameters = std::get_if<station::ReportedParameters>(&content);
  return base::dump(parameters != nullptr ? parameters_json(*parameters)
                                          : controller_json(std::get<protocol::Controller>(content)));
}

json controller_json(const protocol::Controller& controller) {
  return {{"controller_id", controller.controller_id},
          {"checksum", controller.checksum},
          {"period_us", controller.period_us},
          {"kp", decimal(controller.kp)},
          {"direct", decimal(controller.direct)},
          {"pole", numbers(controller.pole, controller.pole_count)},
          {"residue", numbers(controller.residue, controller.residue_count)},
          {"biquad_b0", numbers(controller.biquad_b0, controller.biquad_b0_count)},
          {"biquad_b1", numbers(controller.biquad_b1, controller.biquad_b1_count)},
          {"biquad_a1", numbers(controller.biquad_a1, controller.biquad_a1_count)},
          {"biquad_a2", numbers(controller.biquad_a2, controller.biquad_a2_count)},
          {"duty_min", decimal(controller.duty_min)},
          {"duty_max", decimal(controller.duty_max)},
          {"derivative_on", controller.derivative_on == rheonaut_DERIVATIVE_ON_MEASUREMENT ? "measurement" : "error"}};
}

}  // namespace server::storage
