#include "server/experiments/profile.hpp"

#include <fmt/format.h>

#include <array>
#include <utility>

#include "control/search/fit.hpp"

namespace server::experiments {
namespace {

constexpr std::array<const char*, 11> kStepKinds{"rest",      "duty",     "staircase",   "ramp", "chirp", "prbs",
                                                 "multisine", "setpoint", "disturbance", "scan", "tones"};
constexpr std::array<const char*, 3> kPumpFlows{"off", "constant", "pulse_70_bpm"};
constexpr std::array<const char*, 3> kStartPositions{"zero", "here", "back"};

// An empty list is an axis with the one value that changes nothing.
template <class T>
std::vector<T> axis(const std::vector<T>& values, T otherwise) {
  return values.empty() ? std::vector<T>{std::move(otherwise)} : values;
}

}  // namespace

std::span<const char* const> step_kinds() { return kStepKinds; }

std::span<const char* const> pump_flows() { return kPumpFlows; }

std::span<const char* const> start_positions() { return kStartPositions; }

std::string text(const Until& until) {
  return fmt::format("sigma({}) <= {}", control::kParameterNames.at(until.parameter), until.sigma);
}

Profile profile_of_run(const Profile& profile, const Variant& variant) {
  Profile of_run = profile;
  of_run.until.reset();
  if (variant.step > 0) of_run.steps = {profile.steps.at(variant.step - 1)};
  return of_run;
}

std::vector<Variant> variants_of(const Profile& profile) {
  std::vector<Variant> variants;
  if (profile.until) {
    for (std::size_t step = 1; step <= profile.steps.size(); ++step) {
      for (const double duty_factor : axis(profile.sweep.duty_factor, 1.0)) {
        variants.push_back({profile.conditions.fluid, "", duty_factor, 1, 1, step});
      }
    }
    return variants;
  }
  for (const std::string& fluid : axis(profile.sweep.fluids, profile.conditions.fluid)) {
    for (const std::string& controller : axis(profile.sweep.controllers, std::string{})) {
      for (const double setpoint_factor : axis(profile.sweep.setpoint_factor, 1.0)) {
        for (const double duty_factor : axis(profile.sweep.duty_factor, 1.0)) {
          for (std::uint64_t repeat = 1; repeat <= profile.sweep.repeats; ++repeat) {
            variants.push_back({fluid, controller, duty_factor, setpoint_factor, repeat});
          }
        }
      }
    }
  }
  return variants;
}

}  // namespace server::experiments
