// A plot over time as SVG: lines and a band, with axes and a legend. Gaps stay gaps.
//
// A line has at most four points for each column of pixels (the first, least, greatest and last of its values there),
// so no excursion is lost and the text stays short. Pure.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace server::analysis {

// NaN ends a piece.
struct PlotLine {
  std::string label;
  const char* colour = "#000";
  std::vector<double> time_s, value;
  bool is_dashed = false;
  bool is_dots = false;  // measured now and then: not joined
};

struct PlotBand {
  std::string label;
  const char* colour = "#000";
  std::vector<double> time_s, low, high;
};

struct Plot {
  std::string title;  // with unit
  std::vector<PlotLine> lines;
  std::optional<PlotBand> band;
  double from_s = 0, to_s = 1;  // of the time axis
  int height_px = 190;
};

std::string svg_of(const Plot& plot);

// Round values, about `count` of them, from the first at or above `low` on.
std::vector<double> ticks_between(double low, double high, int count);

std::string html_escaped(const std::string& text);

}  // namespace server::analysis
