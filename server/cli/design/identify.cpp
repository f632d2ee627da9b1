// `rheonaut identify`.
#include "server/cli/design/identify.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "control/identification/identifiability.hpp"
#include "server/analysis/identification_answer.hpp"
#include "server/analysis/search/search_progress.hpp"
#include "server/cli/terminal/exit_status.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/progress.hpp"

namespace server::cli {
namespace {

using control::Fit;
using control::kParameterNames;
using control::kParameters;

std::array<double, kParameters> values_of(const control::FractionalModel& model) {
  return {model.kp, model.b1, model.b2, model.alpha, model.beta};
}

void add_source(CLI::App& command, Identify& options) {
  auto* csv = command.add_option("--csv", options.csv,
                                 "Recording with columns t_s (equally spaced), duty (of a row: from it to the next), "
                                 "and position_m or velocity_m_s");
  csv->check(named());
  auto* run = command.add_option("--run", options.runs,
                                 "A recorded run by its number; may be given several times, for one model of all");
  run->check(whole(1, std::numeric_limits<storage::RunId>::max()))->excludes(csv);
  command.add_option("--data", options.data_dir, "Folder of the station that recorded it (default: rheonaut-data)")
      ->check(named())
      ->needs(run);
  command
      .add_option(
          "--span", options.spans,
          "Which span of the run, if the robot rebooted during it; like the two below for all runs, or once for "
          "each --run in their order")
      ->check(whole(0, std::numeric_limits<std::uint32_t>::max()))
      ->needs(run);
  command.add_option("--from-s", options.from_s, "First second of the span to use")->check(finite())->needs(run);
  command.add_option("--to-s", options.to_s, "Last second of the span to use")->check(finite())->needs(run);
  command
      .add_flag("--cut-at-gaps", options.cuts_at_gaps,
                "Of a run with gaps, use the longest part without one; else they are refused")
      ->needs(run);
  add_word(command, "--channels", options.channels,
           std::array{analysis::ChannelChoice::best, analysis::ChannelChoice::outside, analysis::ChannelChoice::robot},
           "best, outside or robot: whether a position from outside is fitted (default: best, where the run has one)")
      ->needs(run);
  command.add_flag("--with-velocity", options.with_velocity,
                   "Also fit the velocity that the robot recorded, where its position is known");
}

void add_plan(CLI::App& command, Identify& options) {
  Plan& plan = options.plan;
  auto* flag = command.add_flag("--plan", plan.is_wanted, "No recording: what an experiment would tell about --plant");
  flag->excludes(command.get_option("--csv"))->excludes(command.get_option("--run"))->group("Planning");
  const auto add = [&command, flag](const char* name, auto& value, const char* meaning) {
    return command.add_option(name, value, fmt::format("{} (default: {})", meaning, value))
        ->needs(flag)
        ->group("Planning");
  };
  add_word(command, "--plan-duty", plan.duty, std::array{PlannedDuty::prbs, PlannedDuty::step},
           "prbs or step (default: prbs)")
      ->needs(flag)
      ->group("Planning");
  add("--plan-amplitude", plan.amplitude, "Of the duty")->check(from_to(-1, 1));
  add("--plan-duration-s", plan.duration_s, "Length")->check(positive());
  add("--plan-bit-s", plan.bit_s, "Length of a bit of the prbs")->check(positive());
  add("--plan-dt-s", plan.dt_s, "Sampling period")->check(positive());
  add("--plan-position-sd-m", plan.position_sd_m, "Noise of the position; 0: not recorded")->check(non_negative());
  add("--plan-velocity-sd-m-s", plan.velocity_sd_m_s, "Noise of the velocity; 0: not recorded")->check(non_negative());
  add("--plan-acceleration-sd-m-s2", plan.acceleration_sd_m_s2, "Noise of the acceleration; 0: not recorded")
      ->check(non_negative());
}

// Of a flag that was given for all runs, or for each.
template <class Value>
std::optional<Value> value_for(const std::vector<Value>& given, std::size_t run) {
  if (given.empty()) return std::nullopt;
  return given.size() == 1 ? given.front() : given[run];
}

void check_counts(const Identify& options) {
  if (options.runs.size() > control::kMostRecordings) {
    throw UsageError{fmt::format("identify fits at most {} runs together", control::kMostRecordings)};
  }
  const auto check = [&](const char* flag, std::size_t given) {
    if (given <= 1 || given == options.runs.size()) return;
    throw UsageError{fmt::format("{} is given {} times, --run {} times: give it once, or once for each run", flag,
                                 given, options.runs.size())};
  };
  check("--span", options.spans.size());
  check("--from-s", options.from_s.size());
  check("--to-s", options.to_s.size());
}

analysis::RunOfMany run_for(const Identify& options, std::size_t index) {
  const RunChoice choice{options.runs[index], options.data_dir};
  analysis::RunWindow window{value_for(options.spans, index), value_for(options.from_s, index).value_or(0),
                             value_for(options.to_s, index).value_or(std::numeric_limits<double>::infinity()),
                             options.with_velocity, options.cuts_at_gaps};
  auto recording = recording_of(read_run_samples(choice), window, options.channels);
  if (!recording) throw std::runtime_error{fmt::format("run {}: {}", *choice.run, recording.error().detail)};
  return {*choice.run, std::move(*recording)};
}

std::vector<analysis::RunOfMany> recordings_for(const Identify& options) {
  if (options.csv) return {{0, read_recording(*options.csv, options.with_velocity)}};
  if (options.runs.empty()) {
    throw UsageError{"identify needs a recording: give --csv FILE or --run ID (or --plan for a forecast)"};
  }
  check_counts(options);
  std::vector<analysis::RunOfMany> runs;
  for (std::size_t i = 0; i < options.runs.size(); ++i) runs.push_back(run_for(options, i));
  return runs;
}

control::Identification search(const Identify& options, std::span<const analysis::RunOfMany> runs) {
  control::IdentificationOptions settings = options.search;
  settings.names = {"--dead-time-s", "--sensor-lag-s", "--offset", "--structure"};
  Progress shown{"identify", options.form};
  settings.on_progress = [&shown](const control::Progress& progress) {
    const bool has_begun = progress.starts > 0;
    shown.set_detail(analysis::in_words(progress) + (has_begun ? fmt::format(", sse {:.6g}", progress.sse) : ""));
    return true;
  };
  return runs.size() == 1 ? analysis::identify_run(runs.front().recorded, settings)
                          : analysis::identify_runs(runs, settings);
}

// The delay of a fit's readings has the model's dead time in it.
void write_sensor(std::ostream& out, const control::SensorFit& sensor, double dead_time_s) {
  const std::string clock =
      sensor.has_own_clock ? fmt::format("a clock of its own, a sample each {} ms", fixed(1e3 * sensor.period_s, 4))
                           : std::string{"in step with the ticks"};
  const std::string with_dead_time =
      dead_time_s > 0 ? fmt::format(", the dead time of {} ms included,", fixed(1e3 * dead_time_s, 2)) : std::string{};
  fmt::print(out, "sensor: {}; readings {} ms late in the mean{} and by a low pass of {} ms; {} left out\n", clock,
             fixed(1e3 * sensor.delay_s, 2), with_dead_time, fixed(1e3 * sensor.time_constant_s, 2),
             sensor.readings_left_out);
  fmt::print(out, "its bias wandered by {} m/s²; {}\n", cell(sensor.bias_range_m_s2, 2),
             sensor.readings_are_recovered ? "its readings are recovered from the record, without the robot's own bias"
                                           : "the robot's own bias is still in the record, and fitted as a bias");
}

void write_parameters(std::ostream& out, const Fit& fit, bool is_of_one_run) {
  const std::vector<std::size_t> at_bound = control::parameters_at_bound(fit);
  std::vector<std::string> head{text(fit.structure), "value", "one sigma"};
  if (!at_bound.empty()) head.emplace_back("<that sigma");
  Table table{std::move(head)};
  const auto values = values_of(fit.model);
  for (std::size_t i = 0; i < kParameters; ++i) {
    if (i == 1 && fit.model.b1 == 0) continue;
    std::vector<std::string> row{kParameterNames[i], cell(values[i], 8), cell(fit.one_sigma[i], 3)};
    if (!at_bound.empty()) {
      const bool is_at_bound = std::ranges::find(at_bound, i) != at_bound.end();
      row.emplace_back(is_at_bound ? kSigmaAtBound : "");
    }
    table.row(std::move(row));
  }
  table.write(out);
  const std::string offset = is_of_one_run ? fmt::format("offset {} m, ", cell(fit.offset_m, 4)) : std::string{};
  fmt::print(out, "fit {} %, residual sd {}, sse {}; {}dead time {} s\n", fixed(fit.fit_percent, 3),
             cell(fit.residual_sd, 4), cell(fit.sse), offset, cell(fit.model.dead_time_s, 4));
  const char* residuals = !fit.residuals_are_white ? "are not white"
                          : fit.drift_factor > 1   ? "drift, and look white from value to value only"
                                                   : "look white";
  fmt::print(out, "residuals {} (p = {}); {} after {} iterations; {} of {} starts agree\n", residuals,
             cell(fit.whiteness_p_value, 3), text(fit.end), fit.iterations, fit.starts_that_agree, fit.starts);
  if (fit.sensor) write_sensor(out, *fit.sensor, fit.model.dead_time_s);
  if (fit.position_clock_sigma_s) {
    fmt::print(out, "clock of the position from outside: {} ms late, one sigma {} ms\n",
               fixed(1e3 * fit.position_clock_s, 2), cell(1e3 * *fit.position_clock_sigma_s, 2));
  }
}

void write_compared(std::ostream& out, std::span<const Fit> compared) {
  if (compared.size() < 2) return;
  Table table{{"structure", "AIC", "fit (%)", "sse", "free", "kp", "b1", "b2", "alpha", "beta"}};
  for (const Fit& fit : compared) {
    std::vector<std::string> row{text(fit.structure), fixed(fit.aic, 1), fixed(fit.fit_percent, 3), cell(fit.sse),
                                 fmt::format("{}", fit.free_parameters)};
    for (const double value : values_of(fit.model)) row.push_back(cell(value, 5));
    table.row(std::move(row));
  }
  out << '\n';
  table.write(out);
}

void write_estimator(std::ostream& out, const control::EstimatorModel& model) {
  if (model.is_met) {
    fmt::print(out,
               "the robot's estimator can use it, with a fit error of {} % (rheonaut estimator says with which "
               "parameters)\n",
               fixed(100 * model.fit_error, 3));
  } else {
    fmt::print(out, "the robot's estimator cannot use it: {}\n", model.reason);
  }
}

// What belongs to one of several runs.
void write_run(std::ostream& out, const analysis::RunOfMany& of, const Fit& fit) {
  fmt::print(out, "run {}: {}; {}\n", of.run, fmt::join(analysis::channels_of(of.recorded.recording), ", "),
             of.recorded.channels_reason);
  fmt::print(out, "fit {} %, residual sd {}; offset {} m\n", fixed(fit.fit_percent, 3), cell(fit.residual_sd, 4),
             cell(fit.offset_m, 4));
  if (fit.sensor) write_sensor(out, *fit.sensor, fit.model.dead_time_s);
}

void write_text(std::ostream& out, std::span<const analysis::RunOfMany> runs, const control::Identification& found) {
  const analysis::RunRecording& first = runs.front().recorded;
  if (runs.size() == 1) {
    fmt::print(out, "fitted: {}; {}\n\n", fmt::join(analysis::channels_of(first.recording), ", "),
               first.channels_reason);
  } else {
    for (std::size_t i = 0; i < runs.size(); ++i) write_run(out, runs[i], found.runs[i].fit);
    out << '\n';
  }
  write_parameters(out, found.best, runs.size() == 1);
  const auto chi_square = runs.size() == 1 ? analysis::chi_square_of(first, found.best) : std::nullopt;
  if (chi_square) {
    fmt::print(out, "chi-square of the position from outside: {} with {} degrees of freedom\n",
               fixed(chi_square->value, 1), chi_square->degrees_of_freedom);
  }
  if (const auto estimator = analysis::estimator_of(found.best)) write_estimator(out, *estimator);
  write_compared(out, found.compared);
  for (const std::string& warning : found.warnings) fmt::print(out, "\nwarning: {}\n", warning);
  if (runs.size() == 1) return;
  for (const std::string& warning : analysis::warnings_of_runs(runs, found)) {
    fmt::print(out, "\nwarning: {}\n", warning);
  }
}

// Of which the model explains nothing: "0.3 % of run 7".
std::vector<std::string> unexplained_runs(std::span<const analysis::RunOfMany> runs,
                                          const control::Identification& found) {
  std::vector<std::string> words;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const control::Fit& fit = found.runs.empty() ? found.best : found.runs[i].fit;
    if (!control::explains_nothing(runs[i].recorded.recording, fit)) continue;
    const std::string run = runs.size() == 1 ? "the run" : fmt::format("run {}", runs[i].run);
    words.push_back(fmt::format("{} % of {}", fixed(fit.fit_percent, 1), run));
  }
  return words;
}

}  // namespace

void add_search(CLI::App& command, control::IdentificationOptions& options) {
  using control::Cost;
  using control::Structure;
  add_word(command, "--structure", options.structure,
           std::array{Structure::first_order, Structure::second_order, Structure::fractional},
           "first_order, second_order or fractional (default: all three, the best by AIC)");
  add_word(command, "--cost", options.cost, std::array{Cost::least_squares, Cost::absolute_error},
           "least_squares or absolute_error (default: least_squares)");
  command.add_flag("--offset,!--no-offset", options.fits_offset,
                   "Whether the initial position is fitted too (default: it is, where position is recorded)");
  command
      .add_option("--dead-time-s", options.longest_dead_time_s,
                  "Find a dead time up to this; 0: none (default: up to 0.2, where the record asks for one)")
      ->check(non_negative())
      ->each([&options](const std::string&) { options.tries_dead_time = false; });
  command
      .add_option("--sensor-lag-s", options.sensor_lag_s,
                  "Of a fitted acceleration: the sensor's own lag, beyond sampling and low pass; what comes later is "
                  "a dead time (default: not known)")
      ->check(non_negative());
  command.add_option("--time-limit-s", options.time_limit_s, "Of the search (default: 300)")->check(positive());
}

control::IdentificationOptions usual_search() {
  control::IdentificationOptions options;
  options.tries_dead_time = true;
  return options;
}

nlohmann::json given_of(const control::IdentificationOptions& search) {
  const control::IdentificationOptions usual = usual_search();
  nlohmann::json given = nlohmann::json::object();
  if (search.structure) given["structure"] = analysis::text(*search.structure);
  if (search.cost != usual.cost) given["cost"] = analysis::text(search.cost);
  if (search.fits_offset != usual.fits_offset) given["fits_offset"] = search.fits_offset;
  if (!search.tries_dead_time) given["dead_time_s"] = search.longest_dead_time_s;
  if (search.sensor_lag_s) given["sensor_lag_s"] = *search.sensor_lag_s;
  if (search.time_limit_s != usual.time_limit_s) given["time_limit_s"] = search.time_limit_s;
  return given;
}

void add_options(CLI::App& command, Identify& options) {
  add_source(command, options);
  add_search(command, options.search);
  command.add_flag("--residuals", options.with_residuals, "With --json: also the residuals, measured less model");
  add_json_flag(command, options.form);
  command.get_option("--residuals")->needs("--json");
  add_plan(command, options);
  add_option(command, options.plant);
  command.get_option("--plant")->needs("--plan")->group("Planning");
  for (const char* searching :
       {"--structure", "--cost", "--dead-time-s", "--sensor-lag-s", "--time-limit-s", "--residuals"}) {
    command.get_option("--plan")->excludes(searching);
  }
  command.footer(
      "Exit status 4: the search did not converge, or the model explains nothing of any run; what was found is "
      "printed.\n"
      "Example: rheonaut identify --csv run.csv --structure fractional");
}

int run(const Identify& options, std::ostream& out) {
  if (options.plan.is_wanted) return run_plan(options, out);
  const std::vector<analysis::RunOfMany> runs = recordings_for(options);
  for (const analysis::RunOfMany& one : runs) {
    for (const std::string& warning : one.recorded.warnings) fmt::print(stderr, "rheonaut: warning: {}\n", warning);
  }
  const control::Identification found = search(options, runs);
  if (analysis::is_out_of_time(found.best)) {
    throw std::runtime_error{fmt::format(
        "the search reached its time limit, {:g} s, so there is no model: raise --time-limit-s, or search for "
        "one --structure, for no dead time (--dead-time-s 0), or in a shorter part of the record",
        options.search.time_limit_s)};
  }
  if (options.form.is_json) {
    write_json(out, runs.size() == 1 ? analysis::answer_json(runs.front().recorded, found, options.with_residuals)
                                     : analysis::answer_json(runs, found, options.with_residuals));
  } else {
    write_text(out, runs, found);
  }
  if (!std::isfinite(found.best.sse)) {
    fmt::print(stderr,
               "rheonaut: no model fits this recording with finite numbers; are its units and columns right?\n");
    return kNotConverged;
  }
  const std::vector<std::string> unexplained = unexplained_runs(runs, found);
  if (unexplained.size() == runs.size()) {
    fmt::print(stderr,
               "rheonaut: the model explains {}, so its parameters say nothing; record a run in which the duty changes "
               "and the robot moves\n",
               fmt::join(unexplained, " and "));
    return kNotConverged;
  }
  if (!unexplained.empty()) {
    fmt::print(stderr, "rheonaut: warning: the model explains {} only; its parameters come from the other runs\n",
               fmt::join(unexplained, " and "));
  }
  return found.best.end == control::SearchEnd::converged
             ? 0
             : not_done(kNotConverged, "the search did not converge; what is printed is the best that it found");
}

}  // namespace server::cli
