// Names of fluids, and the strictest of their limits.
#include "server/config/envelope.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <ranges>

namespace server::config {
namespace {

constexpr std::size_t kMaxNameBytes = 40;

char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

CommandLimits stricter(const CommandLimits& a, const CommandLimits& b) {
  return {.setpoint_min_m = std::max(a.setpoint_min_m, b.setpoint_min_m),
          .setpoint_max_m = std::min(a.setpoint_max_m, b.setpoint_max_m),
          .setpoint_step_m = std::min(a.setpoint_step_m, b.setpoint_step_m),
          .duty_min = std::max(a.duty_min, b.duty_min),
          .duty_max = std::min(a.duty_max, b.duty_max),
          .power_duty = std::min(a.power_duty, b.power_duty),
          .power_s = std::min(a.power_s, b.power_s),
          .disturbance_max_m = std::min(a.disturbance_max_m, b.disturbance_max_m)};
}

}  // namespace

bool is_narrower_than(const CommandLimits& limits, const CommandLimits& others) {
  return stricter(limits, others) != others;
}

std::string fluid_name(std::string_view text) {
  constexpr std::string_view kBlanks = " \t\r\n";
  const auto first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return {};
  std::string name{text.substr(first, text.find_last_not_of(kBlanks) - first + 1)};
  const auto is_control = [](unsigned char c) { return c < 0x20 || c == 0x7f; };
  if (name.size() > kMaxNameBytes || std::ranges::any_of(name, is_control)) return {};
  std::ranges::transform(name, name.begin(), lower);
  return name;
}

Envelope::Envelope(CommandLimits anywhere, std::map<std::string, CommandLimits> of_fluid)
    : anywhere_{anywhere}, of_fluid_{std::move(of_fluid)}, strictest_{anywhere} {
  for (const char* fluid : kBuiltInFluids) of_fluid_.emplace(fluid, anywhere);
  for (const auto& [fluid, limits] : of_fluid_) strictest_ = stricter(strictest_, limits);
}

const CommandLimits& Envelope::in(const std::string& fluid) const {
  const auto listed = of_fluid_.find(fluid);
  return listed == of_fluid_.end() ? strictest_ : listed->second;
}

Result<std::string> Envelope::listed(const std::string& text) const {
  std::string name = fluid_name(text);
  if (text.empty() || is_listed(name)) return name;
  return fail(ErrorCode::invalid,
              fmt::format("fluid = '{}' is none of {}; a section [fluids.NAME] of the station's configuration adds one",
                          text.substr(0, kMaxNameBytes), fmt::join(of_fluid_ | std::views::keys, ", ")),
              "unknown_fluid");
}

}  // namespace server::config
