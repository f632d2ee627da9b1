// The keys of a profile, and what its values must fulfil together.
#include "server/experiments/profile_document.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <utility>

#include "base/field_list.hpp"
#include "base/field_reader.hpp"
#include "base/invalid_argument.hpp"
#include "base/json_table.hpp"
#include "base/toml_text.hpp"
#include "base/whole_file.hpp"
#include "control/tuning/three_tones.hpp"
#include "server/experiments/duty_signals.hpp"
#include "server/experiments/time_line.hpp"
#include "server/experiments/until_rules.hpp"
#include "server/runtime/private_file.hpp"

namespace server::experiments {
namespace {

constexpr std::array<const char*, 11> kStepMeanings{
    "duty 0",
    "a constant duty",
    "constant duties in equal distances",
    "a duty that grows in proportion to the time",
    "a sine whose frequency grows exponentially",
    "a pseudo-random binary sequence: mean_duty plus or minus the amplitude",
    "a sum of sines of one size, with a low peak (Schroeder's phases)",
    "to a position, by the controller",
    "adds to the position that the controller sees",
    "to a position at constant velocity",
    "three sines of the setpoint about a position, from which `autotune --model-free` measures the robot",
};

constexpr base::Range kDuty{-1, 1}, kPosition_m{-100, 100}, kTime_s{kTick_s, 3600}, kFrequency_hz{0.001, 10};
constexpr base::Range kHold_s{0.02, 10};

void timed(base::Fields& fields, Step& step) { fields.number("for_s", step.for_s, kTime_s, "duration of the step"); }

void held(base::Fields& fields, Step& step) {
  fields.number("every_s", step.every_s, kHold_s, "each value holds for so long");
}

void excitation(base::Fields& fields, Step& step) {
  fields.number("amplitude", step.amplitude, {0.001, 1}, "largest difference from mean_duty");
  fields.number("mean_duty", step.mean_duty, kDuty, "duty around which it changes");
}

void band(base::Fields& fields, Step& step) {
  fields.number("from_hz", step.from_hz, kFrequency_hz, "lowest frequency");
  fields.number("to_hz", step.to_hz, kFrequency_hz, "highest frequency");
  held(fields, step);
  fields.must([&step] {
    if (!(step.from_hz < step.to_hz)) {
      base::throw_invalid("to_hz is ", step.to_hz, ", it must be above from_hz, which is ", step.from_hz);
    }
    if (step.to_hz * step.every_s > 0.25) {
      base::throw_invalid("every_s is ", step.every_s,
                          ", at most a quarter of a period of to_hz is allowed: ", 0.25 / step.to_hz);
    }
  });
}

void check_tones(const Step& step) {
  const double shortest_s = control::tone_window_s(step.crossover_rad_s);
  if (step.for_s < shortest_s) {
    base::throw_invalid("for_s is ", step.for_s, ", one period of a tenth of crossover_rad_s is needed: ", shortest_s);
  }
  const double quarter_s = std::numbers::pi / 2 / control::three_tones_rad_s(step.crossover_rad_s).back();
  if (step.every_s > quarter_s) {
    base::throw_invalid("every_s is ", step.every_s,
                        ", at most a quarter of a period of the fastest sine is allowed: ", quarter_s);
  }
}

void fields(base::Fields& fields, Step& step) {
  std::size_t kind = kStepMeanings.size();  // it must be given
  fields.choice("kind", kind, step_kinds(), "what the robot does");
  if (kind < kStepMeanings.size()) step.kind = static_cast<StepKind>(kind);
  switch (step.kind) {
    case StepKind::rest: return timed(fields, step);
    case StepKind::duty: fields.number("duty", step.duty, kDuty, "of the motor"); return timed(fields, step);
    case StepKind::staircase:
    case StepKind::ramp:
      fields.number("from_duty", step.from_duty, kDuty, "duty at the beginning");
      fields.number("to_duty", step.to_duty, kDuty, "duty at the end");
      timed(fields, step);
      if (step.kind == StepKind::ramp) return held(fields, step);
      return fields.whole("levels", step.levels, {2, 100}, "of equal duration, both ends included");
    case StepKind::chirp:
      timed(fields, step);
      excitation(fields, step);
      return band(fields, step);
    case StepKind::multisine:
      timed(fields, step);
      excitation(fields, step);
      fields.whole("tones", step.tones, {1, 50}, "frequencies, spaced logarithmically");
      band(fields, step);
      return fields.must([&step] {
        if (step.for_s * step.from_hz >= 1) return;
        base::throw_invalid("for_s is ", step.for_s, ", at least one period of from_hz is needed: ", 1 / step.from_hz);
      });
    case StepKind::prbs:
      timed(fields, step);
      excitation(fields, step);
      return fields.number("bit_s", step.bit_s, {0.02, 100}, "shortest time between two changes");
    case StepKind::setpoint:
      fields.number("setpoint_m", step.setpoint_m, kPosition_m, "where the robot is to go");
      return timed(fields, step);
    case StepKind::disturbance:
      fields.number("disturbance_m", step.disturbance_m, kPosition_m, "is added to the measured position from now on");
      return timed(fields, step);
    case StepKind::scan:
      fields.number("setpoint_m", step.setpoint_m, kPosition_m, "where the scan ends");
      fields.number("velocity_m_s", step.velocity_m_s, {0.0001, 1}, "of the setpoint on its way there");
      held(fields, step);
      if (std::isnan(step.for_s)) step.for_s = 0;
      return fields.number("for_s", step.for_s, {0, kTime_s.maximum}, "how long the robot then stays");
    case StepKind::tones:
      fields.number("setpoint_m", step.setpoint_m, kPosition_m, "mean of the setpoint");
      fields.number("amplitude_m", step.amplitude_m, {0.0001, 10}, "of each of the three sines");
      fields.number("crossover_rad_s", step.crossover_rad_s, {0.01, 20}, "the sines are at 0.7, 1 and 1.4 times it");
      timed(fields, step);
      held(fields, step);
      return fields.must([&step] { check_tones(step); });
  }
}

void fields(base::Fields& fields, Conditions& conditions) {
  auto pump = static_cast<std::size_t>(conditions.pump);
  std::string fluid = conditions.fluid.empty() ? "any" : conditions.fluid;
  fields.text("fluid", fluid, "name of the fluid; any: the one that the robot is in");
  fields.choice("pump", pump, pump_flows(), "flow in the vessel");
  fields.number("mean_flow_m_s", conditions.mean_flow_m_s, {-1, 1},
                "mean velocity of the flow in the tube where a run begins; 0 if the pump is off");
  auto start = static_cast<std::size_t>(conditions.start);
  fields.choice(
      "start", start, start_positions(),
      "zero: the position counts from where a run begins; here: it goes on; back: as zero, and the robot goes "
      "back to 0 before further runs");
  conditions.start = static_cast<StartPosition>(start);
  conditions.pump = static_cast<PumpFlow>(pump);
  conditions.fluid = fluid == "any" ? "" : fluid;
  fields.must([&conditions] {
    if (conditions.pump == PumpFlow::off && conditions.mean_flow_m_s != 0) {
      base::throw_invalid("mean_flow_m_s is ", conditions.mean_flow_m_s, ", but pump is off");
    }
  });
}

void fields(base::Fields& fields, ProfileLimits& limits) {
  fields.number("position_min_m", limits.position_min_m, kPosition_m, "lowest setpoint and predicted position");
  fields.number("position_max_m", limits.position_max_m, kPosition_m, "highest setpoint and predicted position");
  fields.number("duty_max", limits.duty_max, {0.001, 1}, "largest magnitude of a duty of the profile");
  fields.number("duration_max_s", limits.duration_max_s, {kTick_s, 7200}, "longest run");
  fields.must([&limits] {
    if (!(limits.position_min_m < limits.position_max_m)) {
      base::throw_invalid("position_max_m is ", limits.position_max_m, ", it must be above position_min_m, which is ",
                          limits.position_min_m);
    }
  });
}

void fields(base::Fields& fields, AbortCriteria& abort) {
  fields.number("position_min_m", abort.position_min_m, kPosition_m, "abort when the position less 2 sd is below");
  fields.number("position_max_m", abort.position_max_m, kPosition_m, "abort when the position plus 2 sd is above");
  fields.number("position_sd_max_m", abort.position_sd_max_m, {0.0001, 10}, "abort when the position is less certain");
  fields.number("power_s", abort.power_s, kTime_s, "longest time at a duty beyond 0.9");
  fields.number("gap_s", abort.gap_s, {0.1, 60}, "longest time without a sample; then the experiment is interrupted");
  fields.number("missing_share", abort.missing_share, {0, 1}, "of the samples of the last 10 s");
  fields.flag("sensor_fault", abort.sensor_fault, "abort when the robot reports one");
}

void fields(base::Fields& fields, Sweep& sweep) {
  fields.numbers("duty_factor", sweep.duty_factor, {-1, 1}, "each multiplies the duties");
  fields.numbers("setpoint_factor", sweep.setpoint_factor, {-100, 100}, "each multiplies setpoints and disturbances");
  fields.texts("fluids", sweep.fluids, "instead of that of the conditions");
  fields.texts("controllers", sweep.controllers, "names; instead of the one in force");
  fields.whole("repeats", sweep.repeats, {1, kMostRuns}, "of each combination");
}

std::vector<double> factors_of(const std::vector<double>& listed) {
  return listed.empty() ? std::vector<double>{1} : listed;
}

double largest_magnitude(const std::vector<double>& factors) {
  double largest = 0;
  for (const double factor : factors_of(factors)) largest = std::max(largest, std::abs(factor));
  return largest;
}

void check_duty(const Step& step, const Profile& profile) {
  const double factor = largest_magnitude(profile.sweep.duty_factor);
  for (const DutyChange& change : duty_changes(step)) {
    if (std::abs(change.duty) * factor <= profile.limits.duty_max) continue;
    base::throw_invalid("the duty reaches ", change.duty, factor == 1 ? "" : base::join_text(" times ", factor),
                        ", limits.duty_max is ", profile.limits.duty_max);
  }
}

void check_setpoint(const Step& step, const Profile& profile) {
  for (const double factor : factors_of(profile.sweep.setpoint_factor)) {
    const double setpoint_m = step.setpoint_m * factor;
    const double reach_m = step.kind == StepKind::tones ? std::abs(3 * step.amplitude_m * factor) : 0;
    const auto [lowest_m, highest_m] = std::pair{setpoint_m - reach_m, setpoint_m + reach_m};
    if (lowest_m >= profile.limits.position_min_m && highest_m <= profile.limits.position_max_m) continue;
    base::throw_invalid("setpoint_m is ", step.setpoint_m,
                        reach_m == 0 ? "" : base::join_text(", and three sines of ", step.amplitude_m, " about it"),
                        factor == 1 ? "" : base::join_text(", times the setpoint_factor ", factor),
                        "; the limits of the profile allow ", profile.limits.position_min_m, " to ",
                        profile.limits.position_max_m);
  }
}

// Checks the newest step together with those before it.
void check_newest_step(const Profile& profile) {
  const Step& step = profile.steps.back();
  if (profile.steps.size() > kMostSteps) base::throw_invalid("there are more than ", kMostSteps, " steps");
  // SAFETY: a duty needs somebody who is there.
  if (!is_closed_loop(step.kind) && profile.is_unattended) {
    base::throw_invalid("a profile with unattended = true has only the steps setpoint, disturbance, scan and tones");
  }
  if (profile.until) check_choice(step);
  if (!is_closed_loop(step.kind)) check_duty(step, profile);
  if (has_setpoint(step.kind)) check_setpoint(step, profile);
  const double duration_s = longest_duration_s(profile);
  if (duration_s > profile.limits.duration_max_s) {
    base::throw_invalid("with this step and its for_s a run takes ", duration_s, " s, limits.duration_max_s is ",
                        profile.limits.duration_max_s);
  }
}

void check_number_of_runs(const Sweep& sweep) {
  double runs = static_cast<double>(sweep.repeats);
  for (const std::size_t values :
       {sweep.duty_factor.size(), sweep.setpoint_factor.size(), sweep.fluids.size(), sweep.controllers.size()}) {
    runs *= static_cast<double>(std::max<std::size_t>(values, 1));
  }
  if (runs > kMostRuns) base::throw_invalid("the sweep has ", runs, " runs with its repeats, allowed are ", kMostRuns);
}

}  // namespace

void fields(base::Fields& all, Profile& profile) {
  all.text("name", profile.name, "one line for lists");
  all.text("purpose", profile.purpose, "what the experiment is to show");
  all.table("conditions", "", [&](base::Fields& inside) { fields(inside, profile.conditions); });
  all.table("limits", "", [&](base::Fields& inside) { fields(inside, profile.limits); });
  all.table("abort", "", [&](base::Fields& inside) { fields(inside, profile.abort); });
  all.table("sweep", "", [&](base::Fields& inside) {
    fields(inside, profile.sweep);
    inside.must([&] { check_number_of_runs(profile.sweep); });
  });
  all.flag("unattended", profile.is_unattended, "it may go on while nobody is there; for closed-loop steps alone");
  std::string until = profile.until ? text(*profile.until) : "none";
  all.text("until", until,
           "sigma(alpha) <= 0.02: runs go on until the model's alpha is known so well; each performs the one of the "
           "steps that promises most");
  all.whole("most_runs", profile.most_runs, {1, kMostRunsUntilKnown}, "of a profile with until");
  all.must([&] {
    if (until != "none") profile.until = until_from(until);
    check_until(profile);
  });
  all.tables("step", "", [&](base::Fields& inside) {
    Step step;
    fields(inside, step);
    profile.steps.push_back(step);
    inside.must([&] { check_newest_step(profile); });
  });
  all.must([&] {
    if (profile.steps.empty()) base::throw_invalid("there is no [[step]]");
    check_amount(profile);
  });
}

std::string profile_tables() {
  Profile profile;
  base::FieldList list;
  fields(list, profile);
  std::string text = "| key | default | allowed | what it is |\n|---|---|---|---|\n";
  for (const base::Field& field : list.fields) {
    if (!field.key.starts_with("step[]")) text += base::markdown_row("`" + field.key + "`", field);
  }
  text += "\n| kind of a step | default | allowed | what it is |\n|---|---|---|---|\n";
  for (std::size_t i = 0; i < kStepMeanings.size(); ++i) {
    Step step;
    step.kind = static_cast<StepKind>(i);
    base::FieldList keys;
    fields(keys, step);
    keys.fields.erase(keys.fields.begin());  // kind
    text += keys.markdown_rows(step_kinds()[i], kStepMeanings[i]);
  }
  return text;
}

namespace {

Profile read_profile(const toml::table& table, const std::string& name) {
  Profile profile;
  base::FieldReader reader{table, name};
  fields(reader, profile);
  reader.finish();
  return profile;
}

// Values of JSON have no place in the text: the errors of the reader begin with the key.
Profile parse_json_profile(std::string_view text, const std::string& name) {
  const toml::table table = base::parse_json_table(text, name);
  try {
    return read_profile(table, name);
  } catch (const std::invalid_argument& error) {
    base::throw_invalid(name, ": ", error.what());
  }
}

}  // namespace

Profile parse_profile(std::string_view text, const std::string& name) {
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  if (first != std::string_view::npos && text[first] == '{') return parse_json_profile(text, name);
  return read_profile(base::parse_toml(text, name), name);
}

Profile find_profile(const std::string& name_or_file) {
  std::vector<std::string> names;
  for (const base::EmbeddedFile& shipped : shipped_profiles()) {
    if (shipped.name == name_or_file) return parse_profile(shipped.content, std::string(shipped.name) + ".toml");
    names.emplace_back(shipped.name);
  }
  std::error_code hidden;  // in a folder of another user, which the reader names
  if (!std::filesystem::is_regular_file(name_or_file, hidden) && hidden != std::errc::permission_denied) {
    base::throw_invalid("there is no profile '", name_or_file, "', neither a file nor one of ", base::list_of(names),
                        base::did_you_mean(name_or_file, names));
  }
  const base::WholeFile whole = base::read_whole(std::filesystem::path{name_or_file}, kMaxProfileFileBytes);
  if (whole.error != 0) {
    base::throw_invalid("profile '", name_or_file, "' cannot be read: ", runtime::denial(name_or_file, whole.error));
  }
  if (!whole.problem.empty()) base::throw_invalid("profile '", name_or_file, "' ", whole.problem);
  return parse_profile(whole.text, name_or_file);
}

}  // namespace server::experiments
