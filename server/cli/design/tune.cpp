// `rheonaut tune`.
#include "server/cli/design/tune.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>

#include "control/tuning/tuning_alternatives.hpp"
#include "server/analysis/control_json.hpp"
#include "server/analysis/optional_json.hpp"
#include "server/cli/design/discretise.hpp"
#include "server/cli/design/robustness_table.hpp"
#include "server/cli/terminal/options.hpp"

namespace server::cli {
namespace {

control::RobustnessTable robustness_of(const control::FractionalModel& plant,
                                       const control::FopdController& controller) {
  return control::robustness(plant, discretised(controller, Sampling{}).chosen);
}

void write_asked_and_achieved(std::ostream& out, const Tune& options, const control::TunedController& tuned) {
  const auto& c = tuned.controller;
  fmt::print(out, "kp = {:.8g}, kd = {:.8g}, mu = {:.8g}\n\n", c.kp, c.kd, c.mu);
  const control::Margins& achieved = tuned.achieved;
  Table table{{"specification", "asked", "achieved", "<unit"}};
  table.row({"gain crossover", cell(options.spec.gain_crossover_rad_s), cell(achieved.gain_crossover_rad_s), "rad/s"});
  table.row({"phase margin", cell(options.spec.phase_margin_deg), cell(achieved.phase_margin_deg), "deg"});
  table.row({"phase slope (iso-damping)", options.spec.mu ? "-" : "0", cell(achieved.phase_slope_deg_per_rad_s, 3),
             "deg/(rad/s)"});
  table.row({"Ms", "-", cell(achieved.ms, 4), ""});
  table.row({"Mt", "-", cell(achieved.mt, 4), ""});
  table.write(out);
}

void write_offers(std::ostream& out, const char* title, std::span<const control::TunedController> offers) {
  if (offers.empty()) return;
  Table table{{"kp", "kd", "mu", "crossover (rad/s)", "margin (deg)", "slope (deg/(rad/s))", "<design"}};
  for (const auto& offer : offers) {
    const auto& c = offer.controller;
    const control::Margins& achieved = offer.achieved;
    table.row({cell(c.kp), cell(c.kd), cell(c.mu), cell(achieved.gain_crossover_rad_s, 5),
               cell(achieved.phase_margin_deg, 5), cell(achieved.phase_slope_deg_per_rad_s, 3), offer.name});
  }
  fmt::print(out, "\n{}:\n", title);
  table.write(out);
}

using Ranges = std::vector<control::PhaseMarginRange>;

void write_ranges(std::ostream& out, const Tune& options, const Ranges& ranges) {
  if (ranges.empty()) {
    fmt::print(out, "\nno phase margin has a sound iso-damped design at {} rad/s\n", options.spec.gain_crossover_rad_s);
    return;
  }
  std::vector<std::string> words;
  for (const auto& range : ranges) words.push_back(fmt::format("{:.2f} to {:.2f}", range.low_deg, range.high_deg));
  fmt::print(out, "\niso-damped phase margins at {} rad/s: {} deg\n", options.spec.gain_crossover_rad_s,
             fmt::join(words, ", "));
}

analysis::OrderedJson ends_of(const Ranges& ranges) {
  if (ranges.empty()) return nullptr;
  analysis::OrderedJson ends = analysis::OrderedJson::array();
  for (const auto& range : ranges) ends.insert(ends.end(), {range.low_deg, range.high_deg});
  return ends;
}

analysis::OrderedJson answer_of(const Tune& options, const control::FractionalModel& plant,
                                const control::TuningResult& result, const Ranges& ranges) {
  analysis::OrderedJson answer = analysis::json_of(result);
  answer["feasible_phase_margins_deg"] = ends_of(ranges);
  answer["asked"] = {{"crossover_rad_s", options.spec.gain_crossover_rad_s},
                     {"phase_margin_deg", options.spec.phase_margin_deg},
                     {"mu", analysis::or_null(options.spec.mu)},
                     {"velocity_loop", options.spec.is_velocity_loop}};
  answer["plant"] = analysis::json_of(plant);
  if (options.with_robustness && result.tuned) {
    answer["robustness"] = analysis::json_of(robustness_of(plant, result.tuned->controller));
  }
  return answer;
}

}  // namespace

void add_options(CLI::App& command, Tune& options) {
  add_option(command, options.plant);
  command.add_option("--crossover-rad-s", options.spec.gain_crossover_rad_s, "Gain crossover")
      ->required()
      ->check(positive());
  command.add_option("--phase-margin-deg", options.spec.phase_margin_deg, "Phase margin")->required()->check(finite());
  command
      .add_option("--mu", options.spec.mu, "Order of the derivative, which gives up iso-damping (default: iso-damped)")
      ->check(finite());
  command.add_flag("--velocity-loop", options.spec.is_velocity_loop,
                   "Without the integrator from velocity to position");
  command.add_flag("--robustness", options.with_robustness, "Also predict what becomes of it when the plant differs");
  add_json_flag(command, options.form);
  command.footer(
      "Exit status 3: nothing meets the specification; the answer says why, and what comes near.\n"
      "Example: rheonaut tune --crossover-rad-s 5 --phase-margin-deg 91");
}

int run(const Tune& options, std::ostream& out) {
  const control::FractionalModel plant = read(options.plant);
  const control::TuningResult result = control::tune(plant, options.spec);
  const Ranges ranges = control::sound_phase_margins(plant, options.spec);
  if (options.form.is_json) {
    write_json(out, answer_of(options, plant, result, ranges));
  } else if (result.tuned) {
    write_asked_and_achieved(out, options, *result.tuned);
    write_ranges(out, options, ranges);
    if (options.with_robustness) write_robustness(out, robustness_of(plant, result.tuned->controller));
  } else {
    fmt::print(out, "not feasible: {}\n", result.reason);
    write_ranges(out, options, ranges);
    write_offers(out, "nearest", result.nearest);
    write_offers(out, "relaxed", result.relaxed);
  }
  return result.is_feasible ? 0 : kInfeasible;
}

}  // namespace server::cli
