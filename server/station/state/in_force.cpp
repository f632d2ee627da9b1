// Pages put together, values compared.
#include "server/station/state/in_force.hpp"

#include <algorithm>
#include <bit>
#include <boost/crc.hpp>
#include <string_view>
#include <utility>

namespace server::station {

namespace {

bool is_same_entry(const ReportedParameters::value_type& a, const ReportedParameters::value_type& b) {
  const rheonaut_Parameter& one = a.second;
  const rheonaut_Parameter& other = b.second;
  return a.first == b.first && std::string_view{one.unit} == other.unit && is_same(one.value, other.value) &&
         is_same(one.minimum, other.minimum) && is_same(one.maximum, other.maximum) &&
         is_same(one.default_value, other.default_value);
}

template <std::size_t size>
bool same_list(const float (&a)[size], std::size_t a_count, const float (&b)[size], std::size_t b_count) {
  const auto same = [](float one, float other) { return is_same(one, other); };
  return a_count == b_count && std::equal(a, a + std::min(a_count, size), b, same);
}

}  // namespace

bool ParameterTable::add(const protocol::ParameterPage& page) {
  if (page.total > kMost) return false;
  for (std::size_t i = 0; i < page.parameters_count; ++i) {
    const rheonaut_Parameter& parameter = page.parameters[i];
    if (page.first_index < kMost) names_[page.first_index + static_cast<std::uint32_t>(i)] = parameter.name;
    if (parameters_.size() < kMost || parameters_.contains(parameter.name)) parameters_[parameter.name] = parameter;
  }
  if (parameters_.empty() || parameters_.size() != page.total) return false;
  if (is_current_ && std::ranges::equal(parameters_, last_known_, is_same_entry)) return false;
  is_current_ = true;
  last_known_ = parameters_;
  return true;
}

void ParameterTable::begin_again() {
  parameters_.clear();
  names_.clear();
  is_current_ = false;
}

std::vector<ChangedLimit> ParameterTable::changed_limits() const {
  std::vector<ChangedLimit> changed;
  for (const auto& [name, parameter] : last_known_) {
    if (!bounds_motion(name) || is_same(parameter.value, parameter.default_value)) continue;
    changed.push_back({name, parameter.unit, parameter.value, parameter.default_value});
  }
  return changed;
}

std::uint32_t ParameterTable::checksum() const {
  boost::crc_32_type crc;
  for (const auto& [index, name] : names_) {
    const auto parameter = last_known_.find(name);
    if (parameter == last_known_.end()) continue;
    crc.process_bytes(name.data(), name.size());
    const auto value = std::bit_cast<std::uint32_t>(parameter->second.value);
    for (unsigned shift = 0; shift < 32; shift += 8) crc.process_byte(static_cast<unsigned char>(value >> shift));
  }
  return crc.checksum();
}

bool bounds_motion(const std::string& parameter) {
  constexpr const char* kBounds[] = {"auto_limit_s",         "setpoint_limit_m",     "link_timeout_ms",
                                     "position_limit_min_m", "position_limit_max_m", "power_limit_duty",
                                     "power_limit_s",        "link_loss_action",     "link_loss_limit_s"};
  return std::ranges::find(kBounds, parameter) != std::end(kBounds);
}

bool is_same(float a, float b) { return std::bit_cast<std::uint32_t>(a) == std::bit_cast<std::uint32_t>(b); }

bool is_same(const protocol::Controller& a, const protocol::Controller& b) {
  const bool alike = a.controller_id == b.controller_id && a.checksum == b.checksum && a.period_us == b.period_us &&
                     a.derivative_on == b.derivative_on && is_same(a.kp, b.kp) && is_same(a.direct, b.direct) &&
                     is_same(a.duty_min, b.duty_min) && is_same(a.duty_max, b.duty_max);
  return alike && same_list(a.pole, a.pole_count, b.pole, b.pole_count) &&
         same_list(a.residue, a.residue_count, b.residue, b.residue_count) &&
         same_list(a.biquad_b0, a.biquad_b0_count, b.biquad_b0, b.biquad_b0_count) &&
         same_list(a.biquad_b1, a.biquad_b1_count, b.biquad_b1, b.biquad_b1_count) &&
         same_list(a.biquad_a1, a.biquad_a1_count, b.biquad_a1, b.biquad_a1_count) &&
         same_list(a.biquad_a2, a.biquad_a2_count, b.biquad_a2, b.biquad_a2_count);
}

void RobotSettings::begin_again() {
  parameters.begin_again();
  is_controller_current = false;
  controller_before.reset();
}

void RobotSettings::add(const protocol::Controller& reported, const std::optional<protocol::Controller>& former,
                        std::int64_t at_us) {
  controller_before = former;
  controller = reported;
  controller_at_us = at_us;
  is_controller_current = true;
}

}  // namespace server::station
