// A plot over time or position as SVG: lines and bands, with axes and a legend. Gaps stay gaps.
//
// A line has at most four points for each column of pixels (the first, least, greatest and last of its values there),
// so no excursion is lost and the text stays short. Pure.
#pragma once

#include <string>
#include <vector>

namespace server::analysis {

// NaN ends a piece.
struct PlotLine {
  std::string label;
  std::string colour = "#000";  // of CSS, which a page may change for the dark: "var(--run-1)"
  std::vector<double> x, value;
  bool is_dashed = false;
  bool is_dots = false;  // measured now and then: not joined
};

struct PlotBand {
  std::string label;
  std::string colour = "#000";
  std::vector<double> x, low, high;
};

// Shaded over the whole height.
struct PlotStretch {
  double from = 0, to = 0;
};

struct Plot {
  std::string title;  // with unit
  std::vector<PlotLine> lines;
  std::vector<PlotBand> bands;
  std::vector<PlotStretch> stretches;
  std::string stretch_label;
  double x_from = 0, x_to = 1;  // of the axis
  std::string x_title;          // below it, with unit; may be empty
  int height_px = 190;          // of what is drawn; a legend that needs more rows, and x_title, come on top
};

std::string svg_of(const Plot& plot);

// Round values, about `count` of them, from the first at or above `low` on.
std::vector<double> ticks_between(double low, double high, int count);

std::string html_escaped(const std::string& text);

}  // namespace server::analysis
