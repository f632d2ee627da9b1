// `rheonaut tune`.
#include "server/cli/design/tune.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>

#include "control/tuning/tuning_alternatives.hpp"
#include "server/analysis/tuning/margin_sigmas.hpp"
#include "server/analysis/tuning/tuning_json.hpp"
#include "server/analysis/tuning/tuning_ranges.hpp"
#include "server/cli/design/discretise.hpp"
#include "server/cli/design/robustness_table.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/progress.hpp"

namespace server::cli {
namespace {

control::RobustnessTable robustness_of(const control::FractionalModel& plant,
                                       const control::FopdController& controller) {
  return control::robustness(plant, discretised(controller, Sampling{}).chosen);
}

void write_asked_and_achieved(std::ostream& out, const Tune& options, const control::TunedController& tuned) {
  const auto& c = tuned.controller;
  fmt::print(out, "kp = {:.8g}, kd = {:.8g}, mu = {:.8g}\n\n", c.kp, c.kd, c.mu);
  const auto &achieved = tuned.achieved, &sampled = tuned.sampled;
  Table table{{"specification", "asked", "achieved", "as the robot runs it", "<unit"}};
  const auto row = [&](const char* name, const std::string& asked, const std::optional<double>& of_loop,
                       const std::optional<double>& of_robot, int digits, const char* unit) {
    table.row({name, asked, cell(of_loop, digits), cell(of_robot, digits), unit});
  };
  row("gain crossover", cell(options.spec.gain_crossover_rad_s), achieved.gain_crossover_rad_s,
      sampled.gain_crossover_rad_s, 6, "rad/s");
  row("phase margin", cell(options.spec.phase_margin_deg), achieved.phase_margin_deg, sampled.phase_margin_deg, 6,
      "deg");
  row("phase slope (iso-damping)", options.spec.mu ? "-" : "0", achieved.phase_slope_deg_per_rad_s,
      sampled.phase_slope_deg_per_rad_s, 3, "deg/(rad/s)");
  row("Ms", "-", achieved.ms, sampled.ms, 4, "");
  row("Mt", "-", achieved.mt, sampled.mt, 4, "");
  table.write(out);
  fmt::print(out,
             "achieved: the continuous loop, as in the paper. The robot holds its duty for {:g} s, half of which "
             "counts as dead time\n",
             options.spec.period_s);
  const std::string remark = control::remark_on(c, tuned.spec.gain_crossover_rad_s);
  if (!remark.empty()) fmt::print(out, "warning: {}\n", remark);
}

void write_offers(std::ostream& out, const char* title, std::span<const control::TunedController> offers) {
  if (offers.empty()) return;
  Table table{
      {"kp", "kd", "mu", "crossover (rad/s)", "margin (deg)", "on the robot (deg)", "slope (deg/(rad/s))", "<design"}};
  for (const auto& offer : offers) {
    const auto& c = offer.controller;
    const control::Margins& achieved = offer.achieved;
    table.row({cell(c.kp), cell(c.kd), cell(c.mu), cell(achieved.gain_crossover_rad_s, 5),
               cell(achieved.phase_margin_deg, 5), cell(offer.sampled.phase_margin_deg, 5),
               cell(achieved.phase_slope_deg_per_rad_s, 3), offer.name});
  }
  fmt::print(out, "\n{}:\n", title);
  table.write(out);
}

using Ranges = std::vector<control::PhaseMarginRange>;

std::string ranges_in_words(const Ranges& ranges) {
  std::vector<std::string> words;
  for (const auto& range : ranges) words.push_back(fmt::format("{:.2f} to {:.2f}", range.low_deg, range.high_deg));
  return fmt::format("{}", fmt::join(words, ", "));
}

void write_ranges(std::ostream& out, const Tune& options, const Ranges& ranges) {
  if (ranges.empty()) {
    fmt::print(out, "\nno phase margin has a sound iso-damped design at {} rad/s\n", options.spec.gain_crossover_rad_s);
    return;
  }
  fmt::print(out, "\niso-damped phase margins at {} rad/s: {} deg\n", options.spec.gain_crossover_rad_s,
             ranges_in_words(ranges));
}

analysis::OrderedJson answer_of(const Tune& options, const Plant& plant, const control::TuningResult& result,
                                const Ranges& ranges) {
  analysis::OrderedJson answer = analysis::tuning_json(plant.model, options.spec, result, ranges);
  analysis::add_margin_sigmas(plant.model, result, plant.uncertainty, answer);
  analysis::add_plant_doubts(plant.doubts, answer);
  if (options.with_robustness && result.tuned) {
    answer["robustness"] = analysis::json_of(robustness_of(plant.model, result.tuned->controller));
  }
  return answer;
}

void write_map_table(std::ostream& out, std::span<const control::TuningMapPoint> map) {
  Table table{{"crossover (rad/s)", "lowest margin (deg)", "highest (deg)", "<ranges or reason"}};
  for (const control::TuningMapPoint& point : map) {
    const bool is_empty = point.ranges.empty();
    const std::string words = is_empty ? analysis::text(point.reason) : ranges_in_words(point.ranges);
    table.row({cell(point.gain_crossover_rad_s, 5), is_empty ? "-" : fixed(point.ranges.front().low_deg, 2),
               is_empty ? "-" : fixed(point.ranges.back().high_deg, 2), words});
  }
  table.write(out);
}

// A line per range; a crossover without one has its reason and no numbers.
void write_map_csv(std::ostream& out, std::span<const control::TuningMapPoint> map) {
  fmt::print(out, "crossover_rad_s,lowest_phase_margin_deg,highest_phase_margin_deg,reason\n");
  for (const control::TuningMapPoint& point : map) {
    for (const auto& range : point.ranges) {
      fmt::print(out, "{},{},{},{}\n", point.gain_crossover_rad_s, range.low_deg, range.high_deg,
                 analysis::text(point.reason));
    }
    if (point.ranges.empty()) fmt::print(out, "{},,,{}\n", point.gain_crossover_rad_s, analysis::text(point.reason));
  }
}

int write_map(const Tune& options, const control::FractionalModel& plant, std::ostream& out) {
  control::TuningMapSpec spec = options.map;
  spec.is_velocity_loop = options.spec.is_velocity_loop;
  spec.period_s = options.spec.period_s;
  const auto map = control::tuning_map(plant, spec);
  if (options.form.is_json) {
    write_json(out, analysis::tuning_map_json(plant, spec, map));
  } else if (options.form.is_csv) {
    write_map_csv(out, map);
  } else {
    write_map_table(out, map);
  }
  return 0;
}

// A map needs no specification, and CSV is of a map alone.
void check_words(const Tune& options, const CLI::Option& crossover, const CLI::Option& margin) {
  if (options.is_map) return;
  for (const CLI::Option* option : {&crossover, &margin}) {
    if (option->count() == 0) throw CLI::RequiredError{option->get_name()};
  }
  if (options.form.is_csv) throw CLI::RequiresError{"--csv", "--map"};
}

CLI::Option* add_map_options(CLI::App& command, Tune& options) {
  auto* map = command.add_flag("--map", options.is_map,
                               "Instead of a controller, which phase margins have one, crossover by crossover");
  command.add_option("--from-rad-s", options.map.from_rad_s, "Of the map (default: 0.5)")
      ->check(crossovers())
      ->needs(map);
  command.add_option("--to-rad-s", options.map.to_rad_s, "Of the map (default: 50)")->check(crossovers())->needs(map);
  command.add_option("--points", options.map.points, "Of the map, spaced logarithmically (default: 60)")
      ->check(whole(2, control::kMostMapPoints))
      ->needs(map);
  return map;
}

}  // namespace

CLI::Validator crossovers() { return from_to(analysis::kLowestCrossover_rad_s, analysis::kHighestCrossover_rad_s); }

CLI::Validator margins() { return from_to(analysis::kSmallestMarginDeg, analysis::kLargestMarginDeg); }

CLI::Validator mus() { return from_to(analysis::kLowestMu, analysis::kHighestMu); }

void add_options(CLI::App& command, Tune& options) {
  add_option(command, options.plant);
  auto* crossover =
      command.add_option("--crossover-rad-s", options.spec.gain_crossover_rad_s, "Gain crossover")->check(crossovers());
  auto* margin =
      command.add_option("--phase-margin-deg", options.spec.phase_margin_deg, "Phase margin")->check(margins());
  auto* mu = command
                 .add_option("--mu", options.spec.mu,
                             "Order of the derivative, which gives up iso-damping (default: iso-damped)")
                 ->check(mus());
  command
      .add_option("--period-s", options.spec.period_s,
                  "For how long the robot holds its duty; 0: not sampled, as in the paper (default: 0.01)")
      ->check(from_to(0, analysis::kLongestPeriod_s));
  command.add_flag("--velocity-loop", options.spec.is_velocity_loop,
                   "Without the integrator from velocity to position");
  auto* robustness = command.add_flag("--robustness", options.with_robustness,
                                      "Also predict what becomes of it when the plant differs");
  CLI::Option* map = add_map_options(command, options);
  for (CLI::Option* option : {crossover, margin, mu, robustness}) option->excludes(map);
  add_json_and_csv_flags(command, options.form);
  command.parse_complete_callback([&options, crossover, margin] { check_words(options, *crossover, *margin); });
  command.footer(
      "Exit status 3: nothing meets the specification; the answer says why, and what comes near.\n"
      "Example: rheonaut tune --crossover-rad-s 5 --phase-margin-deg 91\n"
      "         rheonaut tune --map --from-rad-s 1 --to-rad-s 10 --csv > map.csv");
}

int run(const Tune& options, std::ostream& out) {
  const Progress progress{"tune", options.form};
  const Plant plant = read(options.plant);
  say_doubts(options.plant, plant);
  if (options.is_map) return write_map(options, plant.model, out);
  const control::TuningResult result = control::tune(plant.model, options.spec);
  const Ranges ranges = control::sound_phase_margins(plant.model, options.spec);
  if (options.form.is_json) {
    write_json(out, answer_of(options, plant, result, ranges));
  } else if (result.tuned) {
    write_asked_and_achieved(out, options, *result.tuned);
    say_margin_sigmas(out, options.plant, analysis::margin_sigmas(plant.model, result, plant.uncertainty));
    write_ranges(out, options, ranges);
    if (options.with_robustness) write_robustness(out, robustness_of(plant.model, result.tuned->controller));
  } else {
    write_ranges(out, options, ranges);
    write_offers(out, "nearest", result.nearest);
    write_offers(out, "relaxed", result.relaxed);
  }
  return result.is_feasible ? 0 : not_done(kInfeasible, "not feasible: " + result.reason);
}

}  // namespace server::cli
