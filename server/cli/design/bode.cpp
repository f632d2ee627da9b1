// `rheonaut bode`.
#include "server/cli/design/bode.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "server/analysis/control_json.hpp"
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

}  // namespace

void add_options(CLI::App& command, Bode& options) {
  add_option(command, options.plant);
  add_option(command, options.controller);
  command.add_flag("--velocity-loop", options.is_velocity_loop, "Without the integrator from velocity to position");
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
      "The margins are those of the open loop, plant times controller.\n"
      "Example: rheonaut bode --plant newtonian --from-rad-s 1 --to-rad-s 100");
}

void write_margins(std::ostream& out, const control::Margins& margins) {
  Table table{{"open loop", "value", "<unit"}};
  table.row({"gain crossover", cell(margins.gain_crossover_rad_s, 8), "rad/s"});
  table.row({"phase margin", cell(margins.phase_margin_deg, 8), "deg"});
  table.row({"phase slope there", cell(margins.phase_slope_deg_per_rad_s, 6), "deg/(rad/s)"});
  table.row({"gain margin", margins.gain_margin_db ? cell(*margins.gain_margin_db) : "infinite", "dB"});
  table.row({"Ms, largest |1/(1+L)|", cell(margins.ms, 5), fmt::format("at {:.4g} rad/s", margins.ms_at_rad_s)});
  table.row({"Mt, largest |L/(1+L)|", cell(margins.mt, 5), fmt::format("at {:.4g} rad/s", margins.mt_at_rad_s)});
  if (margins.gain_crossovers_rad_s.size() > 1) {
    table.row({"all gain crossovers", list(margins.gain_crossovers_rad_s), "rad/s"});
  }
  if (!margins.phase_crossovers_rad_s.empty()) {
    table.row({"phase crossovers", list(margins.phase_crossovers_rad_s), "rad/s"});
  }
  table.write(out);
  if (!margins.is_closed_loop_stable) out << "the closed loop is UNSTABLE: these numbers are no margins\n";
}

int run(const Bode& options, std::ostream& out) {
  const control::OpenLoop loop{read(options.plant), read(options.controller), options.is_velocity_loop};
  if (options.form.is_csv) {
    write_points(out, response(options, loop, options.points.value_or(kCsvPoints)));
    return 0;
  }
  const control::Margins margins = control::margins(loop);
  if (options.form.is_json) {
    if (!options.points && (options.from_rad_s || options.to_rad_s)) {
      throw UsageError{"--from-rad-s and --to-rad-s belong to the response, which --json has with --points"};
    }
    analysis::OrderedJson answer = analysis::json_of(margins);
    answer["plant"] = analysis::json_of(loop.plant);
    answer["controller"] = analysis::json_of(loop.controller);
    answer["velocity_loop"] = options.is_velocity_loop;
    if (options.points)
      answer["response"] =
          analysis::json_of(std::span<const control::BodePoint>(response(options, loop, *options.points)));
    write_json(out, answer);
    return 0;
  }
  write_margins(out, margins);
  out << '\n';
  Table table{{"omega (rad/s)", "magnitude (dB)", "phase (deg)"}};
  for (const auto& point : response(options, loop, options.points.value_or(kTablePoints))) {
    table.row({cell(point.omega_rad_s, 5), fixed(point.magnitude_db, 2), fixed(point.phase_deg, 2)});
  }
  table.write(out);
  return 0;
}

}  // namespace server::cli
