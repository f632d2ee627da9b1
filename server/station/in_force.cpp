// Pages put together, messages written out.
#include "server/station/in_force.hpp"

#include <algorithm>
#include <utility>

#include "server/decimal.hpp"

namespace server {
namespace {

using nlohmann::json;

template <std::size_t size>
json numbers(const float (&values)[size], std::size_t count) {
  json list = json::array();
  for (std::size_t i = 0; i < std::min(count, size); ++i) list.push_back(decimal(values[i]));
  return list;
}

}  // namespace

std::optional<std::string> ParameterTable::add(const protocol::ParameterPage& page) {
  if (page.total > kMost) return std::nullopt;
  for (std::size_t i = 0; i < page.parameters_count; ++i) {
    const rheonaut_Parameter& parameter = page.parameters[i];
    if (parameters_.size() < kMost || parameters_.contains(parameter.name)) parameters_[parameter.name] = parameter;
  }
  if (parameters_.empty() || parameters_.size() != page.total) return std::nullopt;
  json table = json::object();
  for (const auto& [name, parameter] : parameters_) {
    table[name] = {{"value", decimal(parameter.value)},
                   {"unit", parameter.unit},
                   {"minimum", decimal(parameter.minimum)},
                   {"maximum", decimal(parameter.maximum)},
                   {"default", decimal(parameter.default_value)}};
  }
  std::string text = table.dump(-1, ' ', false, json::error_handler_t::replace);
  if (text == told_) return std::nullopt;
  told_ = std::move(text);
  return told_;
}

std::string controller_json(const protocol::Controller& controller) {
  const json out{
      {"controller_id", controller.controller_id},
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
  return out.dump();
}

}  // namespace server
