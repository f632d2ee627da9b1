// The sections of a comparison, each a function.
#include "server/analysis/report/comparison_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "server/analysis/report/impedance_plot.hpp"
#include "server/analysis/report/page.hpp"
#include "server/analysis/report/svg_plot.hpp"

namespace server::analysis {
namespace {

using nlohmann::json;

// In the order of report_channels().
constexpr std::size_t kPositionColumn = 0, kDutyColumn = 1, kImpedanceColumn = 2, kSetpointColumn = 3;

constexpr std::size_t kMostBands = 4;  // more of them hide each other

std::string colour_of_run(std::size_t index) {
  return fmt::format("var(--run-{})", 1 + index % static_cast<std::size_t>(kRunColours));
}

std::string swatch(std::size_t index) {
  return fmt::format("<span class=\"swatch\" style=\"background:{}\"></span>", colour_of_run(index));
}

std::string run_label(const AlignedRun& run) { return fmt::format("run {}", run.id); }

// What the position is, in words.
const char* source_in_words(PositionSource source) {
  switch (source) {
    case PositionSource::outside: return "measured from outside";
    case PositionSource::estimate: return "the robot's estimate";
    case PositionSource::known: break;
  }
  return "known";
}

double largest_sd_m(const AlignedRun& run) {
  double largest_m = 0;
  for (const float sd_m : run.trace.position_sd_m) {
    if (std::isfinite(sd_m)) largest_m = std::max(largest_m, static_cast<double>(sd_m));
  }
  return largest_m;
}

// Of how many positions it is not known stands beside the largest.
std::string two_sd_text(const AlignedRun& run) {
  const std::vector<float>&sds_m = run.trace.position_sd_m, &positions_m = run.trace.values[kPositionColumn];
  std::size_t positions = 0, unknown = 0;
  for (std::size_t i = 0; i < std::min(sds_m.size(), positions_m.size()); ++i) {
    if (!std::isfinite(positions_m[i])) continue;
    ++positions;
    unknown += std::isfinite(sds_m[i]) ? 0 : 1;
  }
  if (unknown == 0) return fmt::format("{:.2g}", 2 * largest_sd_m(run));
  if (unknown == positions) return "not known";
  return fmt::format("{:.2g}; of {} of {} not known", 2 * largest_sd_m(run), unknown, positions);
}

std::string runs_table(const ComparisonReport& report) {
  std::string out =
      "<h2>Runs</h2>\n<div class=\"wide\"><table><tr><th></th><th>Run</th><th>Name</th><th>Robot</th>"
      "<th>Started</th><th class=\"number\">Aligned at (s)</th><th>Position</th>"
      "<th class=\"number\">± 2 sd at most (m)</th></tr>\n";
  for (std::size_t i = 0; i < report.runs.size(); ++i) {
    const storage::Run& run = report.runs[i];
    const AlignedRun& aligned = report.aligned.runs[i];
    out += fmt::format(
        "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td class=\"number\">{:.2f}</td>"
        "<td>{}</td><td class=\"number\">{}</td></tr>\n",
        swatch(i), run.id, html_escaped(run.conditions.name), html_escaped(run.robot_id), utc_text(run.started_at_us),
        aligned.aligned.at_s, html_escaped(source_in_words(aligned.trace.position_source)), two_sd_text(aligned));
  }
  return out + "</table></div>\n";
}

PlotLine line_of_column(const AlignedRuns& aligned, const std::vector<float>& column, std::size_t run) {
  PlotLine line;
  line.label = run_label(aligned.runs[run]);
  line.colour = colour_of_run(run);
  line.x = aligned.time_s;
  line.value.assign(column.begin(), column.end());
  return line;
}

PlotBand band_around(const PlotLine& line, const std::vector<float>& sd_m, const std::string& label) {
  PlotBand band{label, line.colour, line.x, {}, {}};
  for (std::size_t i = 0; i < line.value.size(); ++i) {
    band.low.push_back(line.value[i] - 2 * static_cast<double>(sd_m[i]));
    band.high.push_back(line.value[i] + 2 * static_cast<double>(sd_m[i]));
  }
  return band;
}

bool has_numbers(const std::vector<float>& column) {
  return std::ranges::any_of(column, [](float value) { return std::isfinite(value); });
}

void draw(const AlignedRuns& aligned, Plot& plot, std::string& out) {
  plot.x_from = aligned.time_s.front();
  plot.x_to = aligned.time_s.back();
  out += svg_of(plot);
}

Plot plot_of_channel(const AlignedRuns& aligned, std::size_t channel, const char* title) {
  Plot plot;
  plot.title = title;
  for (std::size_t run = 0; run < aligned.runs.size(); ++run) {
    plot.lines.push_back(line_of_column(aligned, aligned.runs[run].trace.values[channel], run));
  }
  return plot;
}

Plot position_overlay(const AlignedRuns& aligned) {
  Plot plot = plot_of_channel(aligned, kPositionColumn, "Position (m)");
  plot.height_px = 270;
  for (std::size_t run = 0; run < aligned.runs.size() && aligned.runs.size() <= kMostBands; ++run) {
    if (largest_sd_m(aligned.runs[run]) == 0) continue;
    const char* label = plot.bands.empty() ? "± 2 sd" : "";
    plot.bands.push_back(band_around(plot.lines[run], aligned.runs[run].trace.position_sd_m, label));
  }
  const std::vector<float>& setpoint_m = aligned.runs[aligned.reference].trace.values[kSetpointColumn];
  if (has_numbers(setpoint_m)) {
    PlotLine line = line_of_column(aligned, setpoint_m, aligned.reference);
    line.label = fmt::format("setpoint of {}", run_label(aligned.runs[aligned.reference]));
    line.colour = "var(--quiet)";
    line.is_dashed = true;
    plot.lines.push_back(std::move(line));
  }
  return plot;
}

std::string traces_section(const ComparisonReport& report) {
  const AlignedRuns& aligned = report.aligned;
  std::string out = "<h2>Traces</h2>\n";
  Plot position = position_overlay(aligned), duty = plot_of_channel(aligned, kDutyColumn, "Duty");
  draw(aligned, position, out);
  draw(aligned, duty, out);
  Plot impedance = plot_of_channel(aligned, kImpedanceColumn, "Impedance (mV)");
  const bool has_impedance = std::ranges::any_of(
      aligned.runs, [](const AlignedRun& run) { return has_numbers(run.trace.values[kImpedanceColumn]); });
  if (has_impedance) draw(aligned, impedance, out);
  return out + fmt::format(
                   "<p class=\"quiet\">Seconds since {} of each run, by the robots' clocks, every {:.3g} s. Where "
                   "samples are missing, lines are interrupted. A position is shown with the disturbance, as the "
                   "robot's controller sees it; an estimate says what the robot believed, within ± 2 sd.</p>\n",
                   html_escaped(in_words(aligned.request.alignment)), aligned.grid_s);
}

std::string differences_section(const ComparisonReport& report) {
  const AlignedRuns& aligned = report.aligned;
  const std::string from = run_label(aligned.runs[aligned.reference]);
  Plot position, duty;
  position.title = fmt::format("Position less that of {} (m)", from);
  duty.title = fmt::format("Duty less that of {}", from);
  for (std::size_t run = 0; run < aligned.runs.size(); ++run) {
    if (run == aligned.reference) continue;
    position.lines.push_back(line_of_column(aligned, difference(aligned, run, kPositionColumn), run));
    duty.lines.push_back(line_of_column(aligned, difference(aligned, run, kDutyColumn), run));
    const std::vector<float> sd_m = difference_sd_m(aligned, run);
    const bool is_certain = std::ranges::none_of(sd_m, [](float value) { return value > 0; });
    if (is_certain || aligned.runs.size() > kMostBands) continue;
    position.bands.push_back(band_around(position.lines.back(), sd_m, position.bands.empty() ? "± 2 sd" : ""));
  }
  std::string out = "<h2>Differences</h2>\n";
  draw(aligned, position, out);
  draw(aligned, duty, out);
  return out +
         "<p class=\"quiet\">The sd of a difference is that of two independent positions. Two estimates with the "
         "same model err alike, so less than the band says nothing, and more than it is a difference.</p>\n";
}

std::string head_of_measures(const ComparisonReport& report, const char* first) {
  std::string out = fmt::format("<tr><th>{}</th>", first);
  for (std::size_t i = 0; i < report.runs.size(); ++i) {
    out += fmt::format("<th class=\"number\">{} run {}</th>", swatch(i), report.runs[i].id);
  }
  for (const char* name : {"mean", "sd", "± 95 %", "limit"}) out += fmt::format("<th class=\"number\">{}</th>", name);
  return out + "</tr>\n";
}

std::string rows_of_measures(const json& rows) {
  std::string out;
  for (const json& row : rows) {
    out += fmt::format("<tr><td>{}</td>", html_escaped(row.at("name")));
    for (const json& value : row.at("values")) out += fmt::format("<td class=\"number\">{}</td>", number_text(value));
    for (const char* name : {"mean", "sd", "confidence_half_width", "repeatability_limit"}) {
      out += fmt::format("<td class=\"number\">{}</td>", number_text(row.at(name), 3));
    }
    out += "</tr>\n";
  }
  return out;
}

std::string measures_table(const ComparisonReport& report, const char* first, const json& rows) {
  return "<div class=\"wide\"><table>" + head_of_measures(report, first) + rows_of_measures(rows) + "</table></div>\n";
}

std::string steps_section(const ComparisonReport& report) {
  std::string out;
  std::size_t number = 0;
  for (const json& step : report.comparison.at("steps")) {
    if (number == 0) out = "<h2>Steps</h2>\n";
    out += fmt::format("<h3>Step {}: {}</h3>\n", ++number, html_escaped(step.at("cause")));
    out += measures_table(report, "Measure", step.at("measures"));
    for (std::size_t i = 0; i < report.runs.size(); ++i) {
      const auto doubt = step.at("position_doubt").at(i).get<std::string>();
      if (!doubt.empty()) out += fmt::format("<p>Run {}: {}.</p>\n", report.runs[i].id, html_escaped(doubt));
    }
  }
  if (number == 0) return out;
  return out +
         "<p class=\"quiet\">sd: the repeatability standard deviation (ISO 5725). limit: of two further runs 95 % "
         "differ by less, by Student's t for so few. ± 95 %: the confidence of the mean. Steps that were measured by "
         "the robot's estimate say how "
         "repeatable the estimate is.</p>\n";
}

std::string figures_section(const ComparisonReport& report) {
  return "<h2>Figures</h2>\n" + measures_table(report, "Figure", report.comparison.at("figures"));
}

// A condition over the runs, marked where it is not the same in all.
std::string condition_row(const char* name, const std::vector<std::string>& values) {
  const bool is_said = std::ranges::any_of(values, [](const std::string& value) { return !value.empty(); });
  if (!is_said) return {};
  const bool differs = std::ranges::any_of(values, [&](const std::string& value) { return value != values.front(); });
  const char* mark = differs ? " class=\"differs\"" : "";
  std::string out = fmt::format("<tr><th{}>{}</th>", mark, name);
  for (const std::string& value : values) {
    out += fmt::format("<td{}>{}</td>", mark, value.empty() ? "–" : html_escaped(value));
  }
  return out + "</tr>\n";
}

std::string flow_text(const std::optional<double>& mean_flow_m_s) {
  return mean_flow_m_s ? fmt::format("{} m/s", *mean_flow_m_s) : "";
}

std::string conditions_section(const ComparisonReport& report) {
  std::string out = "<h2>Conditions</h2>\n<div class=\"wide\"><table><tr><th></th>";
  for (std::size_t i = 0; i < report.runs.size(); ++i) {
    out += fmt::format("<th>{} run {}</th>", swatch(i), report.runs[i].id);
  }
  out += "</tr>\n";
  const auto row = [&](const char* name, auto of) {
    std::vector<std::string> values;
    for (const storage::Run& run : report.runs) values.push_back(of(run));
    out += condition_row(name, values);
  };
  row("Fluid", [](const storage::Run& run) { return run.conditions.fluid; });
  row("Pump", [](const storage::Run& run) { return run.conditions.pump_profile; });
  row("Mean flow", [](const storage::Run& run) { return flow_text(run.conditions.mean_flow_m_s); });
  row("Tube", [](const storage::Run& run) { return run.conditions.tube; });
  row("Experiment", [](const storage::Run& run) { return run.conditions.profile; });
  row("Operator", [](const storage::Run& run) { return run.conditions.operator_name; });
  row("Robot", [](const storage::Run& run) { return run.robot_id; });
  row("Firmware", [](const storage::Run& run) { return run.firmware_version; });
  row("Controller",
      [](const storage::Run& run) { return fmt::format("{} ({:08x})", run.controller_id, run.controller_checksum); });
  row("Parameters", [](const storage::Run& run) { return fmt::format("{:08x}", run.parameters_checksum); });
  row("Verdict", [](const storage::Run& run) { return run.conditions.verdict; });
  out += "</table></div>\n";
  if (report.comparison.at("differing_conditions").empty()) return out;
  return out +
         "<p class=\"quiet\">≠: not the same in all runs, so the spread of the measures is not that of repeats.</p>\n";
}

std::string origin_section(const ComparisonReport& report) {
  std::string out = "<h2>Origin</h2>\n<table><tr><th>Run</th><th>SHA-256 of its certificate</th></tr>\n";
  for (std::size_t i = 0; i < report.runs.size(); ++i) {
    const std::string& sha256 = report.sha256[i];
    out += fmt::format("<tr><td>{}</td><td>{}</td></tr>\n", report.runs[i].id,
                       sha256.empty() ? "it has none yet" : "<code>" + html_escaped(sha256) + "</code>");
  }
  return out + "</table>\n" + made_by(report.made_at_us, report.program);
}

std::string title_of(const ComparisonReport& report) {
  const std::string& first = report.runs.front().conditions.name;
  const bool same = std::ranges::all_of(report.runs, [&](const auto& run) { return run.conditions.name == first; });
  return same ? fmt::format("{}: {} runs", first, report.runs.size())
              : fmt::format("Comparison of {} runs", report.runs.size());
}

std::string heading_of(const ComparisonReport& report) {
  const std::string title = title_of(report);
  return page_head(title) +
         fmt::format("<h1>{}</h1>\n<p class=\"quiet\">Aligned at {}; differences are from run {}.</p>\n",
                     html_escaped(title), html_escaped(in_words(report.aligned.request.alignment)),
                     report.aligned.runs[report.aligned.reference].id);
}

}  // namespace

TraceChannels report_channels() { return parse_trace_channels("position_m,duty,impedance_mv,setpoint_m").value(); }

std::string html_of(const ComparisonReport& report) {
  return heading_of(report) + runs_table(report) + traces_section(report) + differences_section(report) +
         steps_section(report) + (report.map ? impedance_section(*report.map) : std::string{}) +
         conditions_section(report) + figures_section(report) + origin_section(report) + page_end();
}

}  // namespace server::analysis
