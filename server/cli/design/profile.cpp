// `rheonaut profile`.
#include "server/cli/design/profile.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <limits>
#include <optional>
#include <stdexcept>

#include "server/analysis/control_json.hpp"
#include "server/analysis/optional_json.hpp"
#include "server/cli/terminal/exit_status.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/experiments/preview_band.hpp"
#include "server/experiments/profile_document.hpp"

namespace server::cli {
namespace {

constexpr int kHasProblems = 3;

using analysis::OrderedJson;
using experiments::Preview;
using experiments::Profile;
using experiments::TimeLine;
using experiments::Variant;

struct Predicted {
  Variant variant;
  TimeLine line;
  Preview preview;
  std::optional<experiments::PositionBand> band;  // none: not known
};

// Repeats of a combination are the same, and are predicted once.
std::vector<Predicted> predict(const Profile& profile, const ProfileQuestion& options) {
  const control::ParallelSections sections = discretised(read(options.controller), options.sampling).chosen.sections;
  const Plant given = read(options.plant);
  say_doubts(options.plant, given);
  std::vector<Predicted> runs;
  for (const Variant& variant : experiments::variants_of(profile)) {
    if (variant.repeat > 1) {
      runs.push_back(runs.back());
      runs.back().variant = variant;
      continue;
    }
    PlantChoice choice = options.plant;
    if (!choice.file && variant.fluid == "water") choice.file = "newtonian";
    const Plant plant = choice.file == options.plant.file ? given : read(choice);
    TimeLine line = experiments::time_line_of(profile, variant);
    const Profile of_run = experiments::profile_of_run(profile, variant);
    Preview preview = experiments::preview_of(of_run, line, plant.model, sections);
    std::optional<experiments::PositionBand> band;
    if (plant.uncertainty) {
      const bool is_in_doubt = !analysis::grave_doubts_in_words(plant.doubts).empty();
      band = experiments::band_of({of_run,
                                   line,
                                   plant.model,
                                   *plant.uncertainty,
                                   sections,
                                   {},
                                   experiments::estimate_with(plant.model, is_in_doubt)});
    }
    runs.push_back({variant, std::move(line), std::move(preview), std::move(band)});
  }
  return runs;
}

const char* kind_text(const experiments::Step& step) {
  return experiments::step_kinds()[static_cast<std::size_t>(step.kind)];
}

std::optional<double> largest_sd_m(const Predicted& run) {
  return run.band ? std::optional{std::ranges::max(run.band->sd_m)} : std::nullopt;
}

OrderedJson json_of(const Predicted& run) {
  const Preview& preview = run.preview;
  return {{"fluid", run.variant.fluid.empty() ? OrderedJson(nullptr) : OrderedJson(run.variant.fluid)},
          {"controller", run.variant.controller.empty() ? OrderedJson(nullptr) : OrderedJson(run.variant.controller)},
          {"duty_factor", run.variant.duty_factor},
          {"setpoint_factor", run.variant.setpoint_factor},
          {"repeat", run.variant.repeat},
          {"step", run.variant.step == 0 ? OrderedJson(nullptr) : OrderedJson(run.variant.step)},
          {"duration_s", run.line.duration_s()},
          {"actions", run.line.actions.size()},
          {"position_min_m", preview.position_min_m},
          {"position_max_m", preview.position_max_m},
          {"position_sd_max_m", analysis::or_null(largest_sd_m(run))},
          {"travel_m", preview.travel_m},
          {"at_power_s", preview.at_power_s},
          {"problems", preview.problems}};
}

OrderedJson steps_json(const Profile& profile, const TimeLine& line) {
  OrderedJson steps = OrderedJson::array();
  for (std::size_t i = 0; i < profile.steps.size(); ++i) {
    const double begins_s = profile.until ? 0 : static_cast<double>(line.step_begins[i]) * experiments::kTick_s;
    steps.push_back({{"kind", kind_text(profile.steps[i])}, {"begins_s", begins_s}});
  }
  return steps;
}

// The prediction of one run is that of --csv, column by column.
void write_json(std::ostream& out, const Profile& profile, const std::vector<Predicted>& runs,
                const Predicted& chosen) {
  OrderedJson all = OrderedJson::array();
  for (const Predicted& run : runs) all.push_back(json_of(run));
  const Preview& preview = chosen.preview;
  OrderedJson setpoint_m = OrderedJson::array();
  for (const double value : preview.setpoint_m)
    setpoint_m.push_back(std::isnan(value) ? OrderedJson(nullptr) : OrderedJson(value));
  OrderedJson sd_m, parts_m, true_sd_m;
  if (const auto& band = chosen.band) {
    sd_m = band->sd_m;
    parts_m = {{"parameters", band->parameters_m},
               {"estimator", band->estimator_m},
               {"sensor", band->sensor_m},
               {"start", band->start_m}};
    true_sd_m = band->true_sd_m;
  }
  cli::write_json(out, {{"name", profile.name},
                        {"purpose", profile.purpose},
                        {"until", profile.until ? OrderedJson(text(*profile.until)) : OrderedJson(nullptr)},
                        {"steps", steps_json(profile, chosen.line)},
                        {"runs", std::move(all)},
                        {"t_s", preview.time_s},
                        {"position_m", preview.position_m},
                        {"position_sd_m", std::move(sd_m)},
                        {"position_sd_parts_m", std::move(parts_m)},
                        {"true_position_sd_m", std::move(true_sd_m)},
                        {"velocity_m_s", preview.velocity_m_s},
                        {"duty", preview.duty},
                        {"setpoint_m", std::move(setpoint_m)},
                        {"ignores_flow", profile.conditions.pump != experiments::PumpFlow::off}});
}

void write_problems(std::ostream& out, const std::vector<Predicted>& runs) {
  for (std::size_t i = 0; i < runs.size(); ++i) {
    for (const std::string& problem : runs[i].preview.problems) fmt::print(out, "run {}: {}\n", i + 1, problem);
  }
}

// What each run of a profile with until may be.
void write_choices(std::ostream& out, const Profile& profile, const std::vector<Predicted>& runs) {
  Table table{{"run", "step", "<kind", "duty ×", "duration (s)", "from (m)", "to (m)", "± 2 sd (m)", "travel (m)"}};
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const auto& [variant, line, preview, band] = runs[i];
    const auto sd_m = largest_sd_m(runs[i]);
    table.row({std::to_string(i + 1), std::to_string(variant.step), kind_text(profile.steps[variant.step - 1]),
               cell(variant.duty_factor), fixed(line.duration_s(), 2), fixed(preview.position_min_m, 3),
               fixed(preview.position_max_m, 3), sd_m ? fmt::format("{:.2g}", 2 * *sd_m) : "-",
               fixed(preview.travel_m, 3)});
  }
  table.write(out);
  write_problems(out, runs);
}

void write_table(std::ostream& out, const Profile& profile, const std::vector<Predicted>& runs) {
  fmt::print(out, "{}\n{}\n\n", one_line(profile.name), one_line(profile.purpose));
  Table steps{{"step", "<kind", "begins (s)"}};
  if (profile.until) {
    fmt::print(out, "Until {}, at most {} runs. Each performs one of these:\n\n", text(*profile.until),
               profile.most_runs);
    return write_choices(out, profile, runs);
  }
  for (std::size_t i = 0; i < profile.steps.size(); ++i) {
    const double begins_s = static_cast<double>(runs.front().line.step_begins[i]) * experiments::kTick_s;
    steps.row({std::to_string(i + 1), kind_text(profile.steps[i]), fixed(begins_s, 2)});
  }
  steps.write(out);
  fmt::print(out, "\n");
  Table table{{"run", "<fluid", "<controller", "duty ×", "setpoint ×", "duration (s)", "from (m)", "to (m)",
               "± 2 sd (m)", "travel (m)"}};
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const auto& [variant, line, preview, band] = runs[i];
    const auto sd_m = largest_sd_m(runs[i]);
    table.row({std::to_string(i + 1), variant.fluid.empty() ? "any" : one_line(variant.fluid),
               variant.controller.empty() ? "in force" : one_line(variant.controller), cell(variant.duty_factor),
               cell(variant.setpoint_factor), fixed(line.duration_s(), 2), fixed(preview.position_min_m, 3),
               fixed(preview.position_max_m, 3), sd_m ? fmt::format("{:.2g}", 2 * *sd_m) : "-",
               fixed(preview.travel_m, 3)});
  }
  table.write(out);
  write_problems(out, runs);
  if (profile.conditions.pump == experiments::PumpFlow::off) return;
  fmt::print(out, "The prediction is without the flow of the pump ({}, mean {} m/s).\n",
             experiments::pump_flows()[static_cast<std::size_t>(profile.conditions.pump)],
             profile.conditions.mean_flow_m_s);
}

// Throws UsageError with the names where there is no such profile.
Profile profile_of(const std::string& name_or_file) {
  std::error_code hidden;  // a file that this program may not see is one, too
  const bool is_file = std::filesystem::exists(name_or_file, hidden) || hidden;
  try {
    return experiments::find_profile(name_or_file);
  } catch (const std::invalid_argument& error) {
    if (is_file) throw;
    throw UsageError{error.what()};
  }
}

int list(const ProfileQuestion& options, std::ostream& out) {
  OrderedJson all = OrderedJson::array();
  Table table{{"profile", "<name", "runs", "duration of a run (s)"}};
  for (const base::EmbeddedFile& shipped : experiments::shipped_profiles()) {
    const std::string file{shipped.name};
    const Profile profile = experiments::find_profile(file);
    const std::size_t runs = experiments::variants_of(profile).size();
    const double duration_s = experiments::longest_duration_s(profile);
    table.row({file, profile.name, std::to_string(runs), fixed(duration_s, 2)});
    all.push_back({{"profile", file},
                   {"name", profile.name},
                   {"purpose", profile.purpose},
                   {"runs", runs},
                   {"duration_s", duration_s}});
  }
  if (options.form.is_json) {
    cli::write_json(out, {{"profiles", std::move(all)}});
  } else {
    table.write(out);
  }
  return 0;
}

int print_text(const std::string& name, std::ostream& out) {
  for (const base::EmbeddedFile& shipped : experiments::shipped_profiles()) {
    if (shipped.name != name) continue;
    out << shipped.content;
    return 0;
  }
  throw UsageError{fmt::format("--text prints a profile that comes with the program; '{}' is none", name)};
}

}  // namespace

void add_options(CLI::App& command, ProfileQuestion& options) {
  command.add_option("profile", options.profile, "Name or file (default: list those that come with the program)")
      ->check(named());
  add_option(command, options.plant);
  add_option(command, options.controller);
  add_options(command, options.sampling);
  command.add_flag("--text", options.prints_text, "Print the document of a profile that comes with the program");
  command.add_flag("--keys", options.prints_keys, "Print every key of a profile, as docs/experiments.md has them");
  command.add_option("--run", options.run, "Of the grid: the run that --json and --csv predict sample by sample")
      ->check(whole(1, experiments::kMostRuns));
  add_json_and_csv_flags(command, options.form);
  command.footer("Example: rheonaut profile figure_7");
}

int run(const ProfileQuestion& options, std::ostream& out) {
  if (options.prints_keys) {
    out << experiments::profile_tables();
    return 0;
  }
  if (!options.profile) return list(options, out);
  if (options.prints_text) return print_text(*options.profile, out);
  const Profile profile = profile_of(*options.profile);
  const std::vector<Predicted> runs = predict(profile, options);
  if (options.run > runs.size()) {
    throw UsageError{fmt::format("--run {}: the profile has {} runs", options.run, runs.size())};
  }
  const Predicted& chosen = runs[options.run - 1];
  if (options.form.is_csv) {
    const Preview& preview = chosen.preview;
    const std::vector<double> unknown(preview.time_s.size(), std::numeric_limits<double>::quiet_NaN());
    write_csv(out, {{"t_s", preview.time_s},
                    {"duty", preview.duty},
                    {"velocity_m_s", preview.velocity_m_s},
                    {"position_m", preview.position_m},
                    {"setpoint_m", preview.setpoint_m},
                    {"position_sd_m", chosen.band ? chosen.band->sd_m : unknown}});
  } else if (options.form.is_json) {
    write_json(out, profile, runs, chosen);
  } else {
    write_table(out, profile, runs);
  }
  const bool is_sound = std::ranges::all_of(runs, [](const Predicted& each) { return each.preview.problems.empty(); });
  return is_sound ? 0 : not_done(kHasProblems, "a predicted run leaves the limits");
}

}  // namespace server::cli
