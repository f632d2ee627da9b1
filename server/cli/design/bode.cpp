// `rheonaut bode`.
#include "server/cli/design/bode.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>

#include "control/tuning/design.hpp"
#include "server/analysis/control_json.hpp"
#include "server/analysis/tuning/margin_sigmas.hpp"
#include "server/cli/terminal/exit_status.hpp"
#include "server/cli/terminal/options.hpp"

namespace server::cli {
namespace {

constexpr int kTablePoints = 13, kCsvPoints = 200, kMaxPoints = 100'000;
constexpr double kFrom_rad_s = 0.1, kTo_rad_s = 1000;

std::vector<control::BodePoint> response(const Bode& options, const control::OpenLoop& loop, int points) {
  const double from_rad_s = options.from_rad_s.value_or(kFrom_rad_s), to_rad_s = options.to_rad_s.value_or(kTo_rad_s);
  if (!(to_rad_s > from_rad_s)) {
    throw UsageError{fmt::format("--to-rad-s {} must lie above --from-rad-s {}", to_rad_s, from_rad_s)};
  }
  return control::bode(loop, control::log_spaced(from_rad_s, to_rad_s, points));
}

void write_points(std::ostream& out, std::span<const control::BodePoint> points) {
  std::vector<double> omega, magnitude, phase;
  for (const auto& point : points) {
    omega.push_back(point.omega_rad_s);
    magnitude.push_back(point.magnitude_db);
    phase.push_back(point.phase_deg);
  }
  write_csv(out, {{"omega_rad_s", omega}, {"magnitude_db", magnitude}, {"phase_deg", phase}});
}

std::string list(std::span<const double> values) {
  std::string text;
  for (const double value : values) text += (text.empty() ? "" : ", ") + cell(value, 8);
  return text.empty() ? "-" : text;
}

struct BothMargins {
  control::Margins continuous, sampled;
};

BothMargins margins_of(const Bode& options, control::OpenLoop loop) {
  BothMargins both{control::margins(loop), {}};
  loop.plant = control::with_hold(loop.plant, options.period_s);
  both.sampled = control::margins(loop);
  return both;
}

void write_margins(std::ostream& out, const Bode& options, const BothMargins& both) {
  const auto& [margins, sampled] = both;
  Table table{{"open loop", "continuous", "as the robot runs it", "<unit"}};
  const auto row = [&](const char* name, const std::string& of_loop, const std::string& of_robot,
                       const std::string& unit) { table.row({name, of_loop, of_robot, unit}); };
  const auto peak = [](double value, double at_rad_s) { return fmt::format("{} at {:.4g}", cell(value, 5), at_rad_s); };
  const auto gain_margin = [](const control::Margins& of) {
    return of.gain_margin_db ? cell(*of.gain_margin_db) : "infinite";
  };
  row("gain crossover", cell(margins.gain_crossover_rad_s, 8), cell(sampled.gain_crossover_rad_s, 8), "rad/s");
  row("phase margin", cell(margins.phase_margin_deg, 8), cell(sampled.phase_margin_deg, 8), "deg");
  row("phase slope there", cell(margins.phase_slope_deg_per_rad_s, 6), cell(sampled.phase_slope_deg_per_rad_s, 6),
      "deg/(rad/s)");
  row("gain margin", gain_margin(margins), gain_margin(sampled), "dB");
  row("Ms, largest |1/(1+L)|", peak(margins.ms, margins.ms_at_rad_s), peak(sampled.ms, sampled.ms_at_rad_s), "rad/s");
  row("Mt, largest |L/(1+L)|", peak(margins.mt, margins.mt_at_rad_s), peak(sampled.mt, sampled.mt_at_rad_s), "rad/s");
  const auto lists = [&](const char* name, const std::vector<double>& of_loop, const std::vector<double>& of_robot) {
    row(name, list(of_loop), list(of_robot), "rad/s");
  };
  if (margins.gain_crossovers_rad_s.size() > 1) {
    lists("all gain crossovers", margins.gain_crossovers_rad_s, sampled.gain_crossovers_rad_s);
  }
  if (!margins.phase_crossovers_rad_s.empty()) {
    lists("phase crossovers", margins.phase_crossovers_rad_s, sampled.phase_crossovers_rad_s);
  }
  table.write(out);
  if (!margins.is_closed_loop_stable) {
    out << "the closed loop is UNSTABLE: these numbers are no margins\n";
  } else if (!sampled.is_closed_loop_stable) {
    fmt::print(out, "the closed loop is UNSTABLE as a robot runs it that holds its duty for {:g} s\n",
               options.period_s);
  }
}

}  // namespace

void add_options(CLI::App& command, Bode& options) {
  add_option(command, options.plant);
  add_option(command, options.controller);
  command.add_flag("--velocity-loop", options.is_velocity_loop, "Without the integrator from velocity to position");
  command
      .add_option("--period-s", options.period_s,
                  "For how long the robot holds its duty; 0: not sampled (default: 0.01)")
      ->check(non_negative());
  command.add_option("--from-rad-s", options.from_rad_s, "First frequency of the response (default: 0.1)")
      ->check(positive());
  command.add_option("--to-rad-s", options.to_rad_s, "Last frequency (default: 1000)")->check(positive());
  command
      .add_option("--points", options.points,
                  "How many frequencies, evenly in the logarithm (default: 13 in the table, 200 in CSV); with --json "
                  "adds the response")
      ->check(whole(2, kMaxPoints));
  add_json_and_csv_flags(command, options.form);
  command.footer(
      "The margins are those of the open loop, plant times controller: continuous, as in the paper, and as the robot\n"
      "runs it, which holds its duty for a period. Half a period counts as dead time.\n"
      "Example: rheonaut bode --plant newtonian --from-rad-s 1 --to-rad-s 100");
}

int run(const Bode& options, std::ostream& out) {
  const Plant plant = read(options.plant);
  say_doubts(options.plant, plant);
  const control::OpenLoop loop{plant.model, read(options.controller), options.is_velocity_loop};
  if (options.form.is_csv) {
    write_points(out, response(options, loop, options.points.value_or(kCsvPoints)));
    return 0;
  }
  const BothMargins margins = margins_of(options, loop);
  const auto sigmas = analysis::margin_sigmas(loop, margins.continuous, plant.uncertainty);
  if (options.form.is_json) {
    if (!options.points && (options.from_rad_s || options.to_rad_s)) {
      throw UsageError{"--from-rad-s and --to-rad-s belong to the response, which --json has with --points"};
    }
    analysis::OrderedJson answer = analysis::json_of(margins.continuous);
    analysis::add_margin_sigmas(sigmas, answer);
    answer["sampled"] = analysis::json_of(margins.sampled);
    answer["sampled"]["period_s"] = options.period_s;
    answer["plant"] = analysis::json_of(loop.plant);
    analysis::add_plant_doubts(plant.doubts, answer);
    answer["controller"] = analysis::json_of(loop.controller);
    answer["velocity_loop"] = options.is_velocity_loop;
    if (options.points)
      answer["response"] =
          analysis::json_of(std::span<const control::BodePoint>(response(options, loop, *options.points)));
    write_json(out, answer);
    return 0;
  }
  write_margins(out, options, margins);
  if (margins.continuous.is_closed_loop_stable) say_margin_sigmas(out, options.plant, sigmas);
  out << '\n';
  Table table{{"omega (rad/s)", "magnitude (dB)", "phase (deg)"}};
  for (const auto& point : response(options, loop, options.points.value_or(kTablePoints))) {
    table.row({cell(point.omega_rad_s, 5), fixed(point.magnitude_db, 2), fixed(point.phase_deg, 2)});
  }
  table.write(out);
  return 0;
}

}  // namespace server::cli
