// A line and a band for each direction, with the events as dots.
#include "server/analysis/report/impedance_plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "server/analysis/report/page.hpp"
#include "server/analysis/report/svg_plot.hpp"
#include "server/storage/samples/position_sd.hpp"

namespace server::analysis {
namespace {

constexpr double kNoValue = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kMostEventsListed = 200;

// Means at the middles of the bins, with a break where a bin has no sample, and their sd.
struct MapLine {
  PlotLine mean;
  PlotBand sd;
};

MapLine line_of_direction(const ImpedanceMap& map, Direction direction, const char* label, const char* colour) {
  MapLine line;
  line.mean.label = label;
  line.mean.colour = line.sd.colour = colour;
  std::optional<std::int64_t> last;
  const auto add = [&](double x, double mean_mv, double sd_mv) {
    line.mean.x.push_back(x);
    line.mean.value.push_back(mean_mv);
    line.sd.x.push_back(x);
    line.sd.low.push_back(mean_mv - sd_mv);
    line.sd.high.push_back(mean_mv + sd_mv);
  };
  for (const auto& [key, bin] : map.bins) {
    if (key.first != direction) continue;
    const double middle_m = (static_cast<double>(key.second) + 0.5) * map.bin_m;
    if (last && key.second != *last + 1) add(middle_m, kNoValue, 0);
    add(middle_m, bin.mean_mv, bin.sd_mv().value_or(0));
    last = key.second;
  }
  return line;
}

PlotLine dots_of_events(const ImpedanceMap& map, const char* kind, const char* label, const char* colour) {
  PlotLine dots;
  dots.label = label;
  dots.colour = colour;
  dots.is_dots = true;
  std::vector<std::pair<double, double>> points;
  for (const ImpedanceEvent& event : map.events) {
    if (event.kind == kind && std::isfinite(event.position_m)) points.emplace_back(event.position_m, event.value);
  }
  std::ranges::sort(points);
  for (const auto& [x, value] : points) {
    dots.x.push_back(x);
    dots.value.push_back(value);
  }
  return dots;
}

Plot plot_of_map(const ImpedanceMap& map) {
  Plot plot;
  plot.title = "Impedance (mV)";
  plot.x_title = "position (m)";
  plot.height_px = 240;
  std::int64_t lowest = std::numeric_limits<std::int64_t>::max(), highest = std::numeric_limits<std::int64_t>::min();
  for (const auto& [key, bin] : map.bins) {
    lowest = std::min(lowest, key.second);
    highest = std::max(highest, key.second + 1);
  }
  plot.x_from = static_cast<double>(lowest) * map.bin_m;
  plot.x_to = static_cast<double>(highest) * map.bin_m;
  const auto add = [&](MapLine line, bool is_dashed) {
    if (line.mean.x.empty()) return;
    line.mean.is_dashed = is_dashed;
    line.sd.label = plot.bands.empty() ? "± sd" : "";
    plot.bands.push_back(std::move(line.sd));
    plot.lines.push_back(std::move(line.mean));
  };
  add(line_of_direction(map, Direction::forward, "forward", "var(--run-1)"), false);
  add(line_of_direction(map, Direction::backward, "coming back", "var(--run-2)"), true);
  plot.lines.push_back(dots_of_events(map, "detection", "detection", "var(--commanded)"));
  plot.lines.push_back(dots_of_events(map, "delivery_started", "delivery", "var(--outside)"));
  std::erase_if(plot.lines, [](const PlotLine& line) { return line.x.empty(); });
  return plot;
}

std::string events_table(const ImpedanceMap& map) {
  std::string out =
      "<table><tr><th>Event</th><th class=\"number\">Run</th><th class=\"number\">at (s)</th>"
      "<th class=\"number\">position (m)</th><th class=\"number\">± 2 sd (m)</th>"
      "<th class=\"number\">value</th></tr>\n";
  for (std::size_t i = 0; i < map.events.size() && i < kMostEventsListed; ++i) {
    const ImpedanceEvent& event = map.events[i];
    const char* unit = event.kind == "delivery_ended" ? "s" : "mV";
    out += fmt::format(
        "<tr><td>{}</td><td class=\"number\">{}</td><td class=\"number\">{:.2f}</td>"
        "<td class=\"number\">{:.4f}</td><td class=\"number\">{}</td><td class=\"number\">{} {}</td></tr>\n",
        html_escaped(event.kind), event.run, event.at_s, event.position_m, number_text(2 * event.position_sd_m, 2),
        number_text(event.value), unit);
  }
  out += "</table>\n";
  if (map.events.size() <= kMostEventsListed) return out;
  return out + fmt::format("<p class=\"quiet\">And {} more.</p>\n", map.events.size() - kMostEventsListed);
}

}  // namespace

std::string impedance_section(const ImpedanceMap& map) {
  double largest_sd_m = 0;
  for (const auto& [key, bin] : map.bins) largest_sd_m = storage::larger_sd_m(largest_sd_m, bin.position_sd_m);
  std::string out = "<h2>Impedance over position</h2>\n" + svg_of(plot_of_map(map)) + events_table(map);
  out += fmt::format(
      "<p class=\"quiet\">Means of bins of {:.3g} mm, of all runs together; the largest ± 2 sd of a "
      "position in them is {}.</p>\n",
      1e3 * map.bin_m, std::isnan(largest_sd_m) ? "not known" : fmt::format("{:.2g} m", 2 * largest_sd_m));
  const std::vector<std::string> warnings = map.all_warnings();
  if (warnings.empty()) return out;
  out += "<ul class=\"quiet\">";
  for (const std::string& warning : warnings) out += fmt::format("<li>{}</li>", html_escaped(warning));
  return out + "</ul>\n";
}

}  // namespace server::analysis
