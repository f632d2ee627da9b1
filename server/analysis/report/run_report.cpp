// The sections of a report, each a function.
#include "server/analysis/report/run_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>

#include "server/analysis/report/page.hpp"
#include "server/analysis/report/svg_plot.hpp"

namespace server::analysis {
namespace {

using nlohmann::json;

constexpr const char* kMeasured = "var(--measured)";
constexpr const char* kCommanded = "var(--commanded)";
constexpr const char* kOutside = "var(--outside)";
constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();

std::string heading(const RunReport& report) {
  const storage::Run& run = report.run;
  std::string out = page_head(run.conditions.name);
  out += fmt::format("<h1>{}</h1>\n<p class=\"quiet\">Run {} of robot {}, {}{}</p>\n",
                     html_escaped(run.conditions.name), run.id, html_escaped(run.robot_id), utc_text(run.started_at_us),
                     run.ended_at_us ? "" : ", not ended when this report was made");
  if (!run.conditions.verdict.empty()) out += fmt::format("<p>{}</p>\n", html_escaped(run.conditions.verdict));
  return out;
}

std::string conditions(const storage::Run& run) {
  const storage::RunConditions& said = run.conditions;
  std::string flow = said.mean_flow_m_s ? fmt::format("{} m/s", *said.mean_flow_m_s) : "";
  std::string out = "<h2>Conditions</h2>\n";
  out += pairs_of({{"Fluid", said.fluid.empty() ? "not known" : said.fluid},
                   {"Pump", said.pump_profile},
                   {"Mean flow", std::move(flow)},
                   {"Tube", said.tube},
                   {"Operator", said.operator_name},
                   {"Experiment", said.profile},
                   {"Firmware", run.firmware_version},
                   {"Controller", fmt::format("{} (checksum {:08x})", run.controller_id, run.controller_checksum)},
                   {"Parameters", fmt::format("checksum {:08x}", run.parameters_checksum)}});
  if (!said.notes.empty()) out += fmt::format("<p>{}</p>\n", html_escaped(said.notes));
  return out;
}

std::string experiment_line(const storage::RunOrigin& origin, const std::string& profile) {
  return fmt::format("<p>Run {} of experiment {}, profile “{}”, SHA-256 <code>{}</code>.</p>\n", origin.number,
                     origin.experiment, html_escaped(profile), origin.profile_sha256);
}

// Nothing where neither an experiment nor a kept controller is known.
std::string made_with(const RunReport& report) {
  if (!report.run.origin && report.made_with.empty()) return {};
  std::string out = "<h2>Made with</h2>\n";
  if (report.run.origin) out += experiment_line(*report.run.origin, report.run.conditions.profile);
  if (report.made_with.empty()) return out + "<p>No controller that the station keeps is known to be the run's.</p>\n";
  out +=
      "<table><tr><th>Controller</th><th>Designed for the model</th><th>Found from run</th>"
      "<th>In doubt about the model</th></tr>\n";
  for (const ControllerInReport& one : report.made_with) {
    const auto& model = one.model;
    out += fmt::format("<tr><td>{}: {}<br><code>{}</code></td><td>{}</td><td>{}</td><td>{}</td></tr>\n", one.number,
                       html_escaped(one.name), one.sha256,
                       model ? fmt::format("{}: {}", model->number, html_escaped(model->name)) : "not known",
                       one.model_runs.empty() ? "not known" : fmt::format("{}", fmt::join(one.model_runs, ", ")),
                       model ? html_escaped(model->doubts) : "");
  }
  return out + "</table>\n";
}

// A line of each sample, with a break where samples are missing.
template <class Value>
PlotLine line_of_trace(const RunReport& report, const std::vector<double>& times_s, Value value) {
  PlotLine line;
  for (std::size_t i = 0; i < report.trace.size(); ++i) {
    if (i > 0 && !follows(report.trace[i - 1], report.trace[i])) {
      line.x.push_back(times_s[i]);
      line.value.push_back(kNothing);
    }
    line.x.push_back(times_s[i]);
    line.value.push_back(static_cast<double>(value(report.trace[i])));
  }
  return line;
}

PlotBand band_of_trace(const PlotLine& position, const PlotLine& sd) {
  PlotBand band{"± 2 sd", kMeasured, position.x, {}, {}};
  for (std::size_t i = 0; i < position.value.size(); ++i) {
    band.low.push_back(position.value[i] - 2 * sd.value[i]);
    band.high.push_back(position.value[i] + 2 * sd.value[i]);
  }
  return band;
}

// Where it was measured from outside, on the time axis of the plots.
PlotLine outside_line(const RunReport& report, const std::vector<double>& times_s) {
  PlotLine line;
  const storage::OutsidePositions& positions = report.reference->positions;
  const auto in_span = [&](const TracePoint& point) { return point.span == report.reference->reference.span; };
  const auto first = std::ranges::find_if(report.trace, in_span);
  if (first == report.trace.end()) return line;
  const double begins_s = times_s[static_cast<std::size_t>(first - report.trace.begin())];
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const auto since_us = static_cast<std::int64_t>(positions.robot_time_us[i] - first->robot_time_us);
    line.x.push_back(begins_s + 1e-6 * static_cast<double>(since_us));
    line.value.push_back(positions.position_m[i]);
  }
  return line;
}

bool has_value(const PlotLine& line) {
  return std::ranges::any_of(line.value, [](double value) { return std::isfinite(value); });
}

Plot position_plot(const RunReport& report, const std::vector<double>& times_s) {
  Plot plot;
  plot.title = "Position (m)";
  plot.height_px = 260;
  PlotLine position = line_of_trace(report, times_s, [](const TracePoint& point) { return point.position_m; });
  const PlotLine sd = line_of_trace(report, times_s, [](const TracePoint& point) { return point.position_sd_m; });
  const bool is_estimate = std::ranges::any_of(sd.value, [](double value) { return value > 0; });
  if (is_estimate) plot.bands.push_back(band_of_trace(position, sd));
  position.label = is_estimate ? "the robot's estimate" : "position";
  position.colour = kMeasured;
  PlotLine setpoint = line_of_trace(report, times_s, [](const TracePoint& point) { return point.setpoint_m; });
  setpoint.label = "setpoint";
  setpoint.colour = kCommanded;
  setpoint.is_dashed = true;
  plot.lines.push_back(std::move(position));
  if (has_value(setpoint)) plot.lines.push_back(std::move(setpoint));
  if (report.reference) {
    PlotLine outside = outside_line(report, times_s);
    outside.label = "measured from outside";
    outside.colour = kOutside;
    outside.is_dots = true;
    plot.lines.push_back(std::move(outside));
  }
  return plot;
}

template <class Value>
Plot plot_of(const RunReport& report, const std::vector<double>& times_s, const char* title, const char* label,
             const char* colour, Value value) {
  Plot plot;
  plot.title = title;
  plot.lines.push_back(line_of_trace(report, times_s, value));
  plot.lines.back().label = label;
  plot.lines.back().colour = colour;
  return plot;
}

// On the time axis of the plots.
std::vector<PlotStretch> interrupted_stretches(const RunReport& report, const std::vector<double>& times_s) {
  std::vector<PlotStretch> stretches;
  for (const storage::InterruptedPart& part : report.run.interrupted) {
    std::optional<std::size_t> first, last;
    for (std::size_t i = 0; i < report.trace.size(); ++i) {
      const TracePoint& point = report.trace[i];
      if (point.span != part.span || point.robot_time_us < part.from_robot_us) continue;
      if (point.robot_time_us >= part.to_robot_us) break;
      if (!first) first = i;
      last = i;
    }
    if (first) stretches.push_back({times_s[*first], times_s[*last]});
  }
  return stretches;
}

std::string interruptions(const RunReport& report) {
  if (report.run.interrupted.empty()) return {};
  std::string out =
      "<h2>Interruptions</h2>\n<p>The experiment waited here with the robot at rest; then a duty went on where it was "
      "broken off, closed-loop steps began again, or it ended. This is recorded; a fit leaves it out.</p>\n"
      "<table><tr><th class=\"number\">at (s)</th><th class=\"number\">for (s)</th><th>Why</th><th>In "
      "words</th></tr>\n";
  const std::vector<double> times_s = times_of(report.trace);
  for (const storage::InterruptedPart& part : report.run.interrupted) {
    const auto is_from = [&part](const TracePoint& point) {
      return point.span == part.span && point.robot_time_us >= part.from_robot_us;
    };
    const auto first = std::ranges::find_if(report.trace, is_from);
    const double length_s = static_cast<double>(part.to_robot_us - part.from_robot_us) / 1e6;
    out += fmt::format("<tr><td class=\"number\">{}</td><td class=\"number\">{:.2f}</td><td>{}</td><td>{}</td></tr>\n",
                       first == report.trace.end()
                           ? "-"
                           : fmt::format("{:.2f}", times_s[static_cast<std::size_t>(first - report.trace.begin())]),
                       length_s, html_escaped(part.reason), html_escaped(part.detail));
  }
  return out + "</table>\n";
}

std::string plots(const RunReport& report) {
  std::string out = "<h2>Record</h2>\n";
  if (report.trace.empty()) return out + "<p>No sample of this run is stored.</p>\n";
  const std::vector<double> times_s = times_of(report.trace);
  std::vector<Plot> all;
  all.push_back(position_plot(report, times_s));
  all.push_back(
      plot_of(report, times_s, "Duty", "commanded", kCommanded, [](const TracePoint& point) { return point.duty; }));
  all.push_back(plot_of(report, times_s, "Impedance (mV)", "measured", kMeasured,
                        [](const TracePoint& point) { return point.impedance_mv; }));
  const std::vector<PlotStretch> interrupted = interrupted_stretches(report, times_s);
  for (Plot& plot : all) {
    plot.stretches = interrupted;
    plot.stretch_label = "interrupted";
    plot.x_to = times_s.back();
    out += svg_of(plot);
  }
  out +=
      "<p class=\"quiet\">Seconds since the first sample, by the robot's clock. Where samples are missing, lines are "
      "interrupted. A position with a band is the robot's own estimate.</p>\n";
  return out;
}

std::string figures(const json& metrics) {
  std::vector<std::pair<std::string, std::string>> rows;
  for (const auto& [name, value] : metrics.at("figures").items()) rows.emplace_back(name, number_text(value, 6));
  return "<h2>Figures</h2>\n" + pairs_of(rows);
}

std::string steps(const json& metrics) {
  if (metrics.at("steps").empty()) return {};
  std::string out = "<h2>Steps</h2>\n<table><tr><th>Cause</th>";
  for (const char* name :
       {"at (s)", "target (m)", "settling (s)", "overshoot (%)", "rise (s)", "error (m)", "± 2 sd (m)"}) {
    out += fmt::format("<th class=\"number\">{}</th>", name);
  }
  out += "<th>Position</th></tr>\n";
  for (const json& step : metrics.at("steps")) {
    const json& sd_m = step.at("position_sd_m");
    out += fmt::format("<tr><td>{}</td>", html_escaped(step.at("cause")));
    for (const char* name :
         {"at_s", "target_m", "settling_s", "overshoot_percent", "rise_10_90_s", "steady_state_error_m"}) {
      out += fmt::format("<td class=\"number\">{}</td>", number_text(step.at(name)));
    }
    out += fmt::format("<td class=\"number\">{}</td><td>{}</td></tr>\n",
                       sd_m.is_number() ? fmt::format("{:.2g}", 2 * sd_m.get<double>()) : "not known",
                       html_escaped(step.at("position_source")));
  }
  out += "</table>\n";
  for (const json& step : metrics.at("steps")) {
    const auto doubt = step.value("position_doubt", std::string{});
    if (!doubt.empty()) out += fmt::format("<p>At {} s: {}.</p>\n", number_text(step.at("at_s")), html_escaped(doubt));
  }
  return out +
         "<p class=\"quiet\">A step that was measured by the robot's estimate says what the robot "
         "believed, within ± 2 sd.</p>\n";
}

std::string designs(const RunReport& report) {
  if (report.designs.empty()) return {};
  std::string out =
      "<h2>Models and controllers from this run</h2>\n<table><tr><th>Number</th><th>Kind</th><th>Name</th>"
      "<th>In doubt about the model</th></tr>\n";
  for (const DesignOfRun& design : report.designs) {
    out += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n", design.number, design.kind,
                       html_escaped(design.name), html_escaped(design.doubts));
  }
  return out + "</table>\n";
}

std::string origin(const RunReport& report) {
  std::string out = "<h2>Origin</h2>\n";
  out += report.sha256.empty()
             ? std::string{"<p>The run has no certificate yet.</p>\n"}
             : fmt::format("<p>SHA-256 of the run's certificate: <code>{}</code></p>\n", html_escaped(report.sha256));
  if (!report.audit.empty()) {
    out += "<table><tr><th>When</th><th>Who</th><th>What</th><th>Entry</th></tr>\n";
    for (const storage::AuditEntry& entry : report.audit) {
      out += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n", utc_text(entry.note.by.at_us),
                         html_escaped(entry.note.by.actor), html_escaped(entry.note.action), entry.entry);
    }
    out += "</table>\n";
  }
  return out + made_by(report.made_at_us, report.program);
}

}  // namespace

std::string html_of(const RunReport& report) {
  return heading(report) + conditions(report.run) + made_with(report) + plots(report) + interruptions(report) +
         steps(report.metrics) + figures(report.metrics) + designs(report) + origin(report) + page_end();
}

}  // namespace server::analysis
