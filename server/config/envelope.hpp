// The limits of commands: the general ones, and those for each fluid. Pure.
//
// The list of fluids is fixed when the station starts: two are built in, the configuration adds others and may give
// each its own limits. Names are compared without case (of ASCII) and outer blanks; here they stand in lower case.
#pragma once

#include <array>
#include <map>
#include <string>
#include <string_view>

#include "server/runtime/result.hpp"

namespace server::config {

// What the station allows to be commanded.
struct CommandLimits {
  double setpoint_min_m = -1.0;
  double setpoint_max_m = 1.0;
  double setpoint_step_m = 2.0;  // from the setpoint in force, or where there is none from where the robot is
  double duty_min = -1.0;
  double duty_max = 1.0;
  double power_duty = 0.9;         // above this |duty| the motor is at power
  double power_s = 60;             // for so long at most; the time counts down again as fast as it went up
  double disturbance_max_m = 0.5;  // magnitude
  bool operator==(const CommandLimits&) const = default;
};

// In any of its quantities.
bool is_narrower_than(const CommandLimits& limits, const CommandLimits& others);

// As fluids are compared: " Water " is "water". Empty when it is none: nothing but blanks, over 40 bytes, or with
// control characters.
std::string fluid_name(std::string_view text);

class Envelope {
 public:
  static constexpr std::array kBuiltInFluids{"non_newtonian", "water"};

  // `of_fluid`: the limits of further fluids, and of built-in ones that have their own; keys as fluid_name() makes
  // them.
  explicit Envelope(CommandLimits anywhere = {}, std::map<std::string, CommandLimits> of_fluid = {});

  const CommandLimits& anywhere() const { return anywhere_; }
  const std::map<std::string, CommandLimits>& of_fluid() const { return of_fluid_; }  // every listed fluid
  const CommandLimits& strictest() const { return strictest_; }                       // of all, each quantity by itself

  // Those that hold for a robot in this fluid. SAFETY: where the fluid is not known (empty), or not listed, a robot may
  // be in any: the strictest hold.
  const CommandLimits& in(const std::string& fluid) const;

  // The fluid that somebody names, as it is listed; empty for an empty text. invalid, with the list, for any other.
  Result<std::string> listed(const std::string& text) const;
  bool is_listed(const std::string& fluid) const { return of_fluid_.contains(fluid); }

 private:
  CommandLimits anywhere_;
  std::map<std::string, CommandLimits> of_fluid_;
  CommandLimits strictest_;
};

}  // namespace server::config
