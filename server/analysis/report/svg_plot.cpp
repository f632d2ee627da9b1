// Scales, axes and paths.
#include "server/analysis/report/svg_plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

namespace server::analysis {
namespace {

constexpr double kWidth_px = 760, kLeft_px = 62, kRight_px = 12, kTop_px = 26, kBottom_px = 26, kRow_px = 16;
constexpr double kPlotWidth_px = kWidth_px - kLeft_px - kRight_px;
constexpr int kTimeTicks = 8, kValueTicks = 4;
constexpr double kMargin = 0.06;  // of the range, above and below
constexpr const char* kStretchStyle = "fill:currentColor;fill-opacity:0.1";

// From values to pixels.
struct Scale {
  double from = 0, to = 1, begin_px = 0, end_px = 1;
  double operator()(double value) const { return begin_px + (value - from) / (to - from) * (end_px - begin_px); }
};

struct Limits {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  void take(const std::vector<double>& values) {
    for (const double value : values) {
      if (!std::isfinite(value)) continue;
      low = std::min(low, value);
      high = std::max(high, value);
    }
  }
};

Limits limits_of(const Plot& plot) {
  Limits limits;
  for (const PlotLine& line : plot.lines) limits.take(line.value);
  for (const PlotBand& band : plot.bands) {
    limits.take(band.low);
    limits.take(band.high);
  }
  if (!(limits.low <= limits.high)) limits = {0, 1};
  const double range = limits.high - limits.low;
  const double margin = range > 0 ? kMargin * range : std::max(1e-3, 0.1 * std::abs(limits.high));
  return {limits.low - margin, limits.high + margin};
}

// What one column of pixels shows of a line.
struct Column {
  double x_px = 0, first = 0, least = 0, greatest = 0, last = 0;
};

// Appends to a path, a column at a time.
class Path {
 public:
  Path(const Scale& x, const Scale& y) : x_{x}, y_{y} {}

  void add(double x, double value) {
    const double x_px = std::floor(x_(x)) + 0.5;
    if (has_column_ && x_px == column_.x_px) {
      column_.least = std::min(column_.least, value);
      column_.greatest = std::max(column_.greatest, value);
      column_.last = value;
      return;
    }
    finish_column();
    column_ = {x_px, value, value, value, value};
    has_column_ = true;
  }
  void end_piece() {
    finish_column();
    begins_piece_ = true;
  }
  std::string text() {
    end_piece();
    return std::move(text_);
  }

 private:
  void finish_column() {
    if (!has_column_) return;
    has_column_ = false;
    point(column_.first);
    for (const double value : {column_.least, column_.greatest, column_.last}) {
      if (value != written_) point(value);
    }
  }
  void point(double value) {
    fmt::format_to(std::back_inserter(text_), "{}{:.1f} {:.1f}", begins_piece_ ? 'M' : 'L', column_.x_px, y_(value));
    begins_piece_ = false;
    written_ = value;
  }

  const Scale &x_, &y_;
  Column column_;
  bool has_column_ = false, begins_piece_ = true;
  double written_ = 0;
  std::string text_;
};

std::string dots_of(const PlotLine& line, const Scale& x, const Scale& y) {
  std::string out;
  double last_px = -1;
  for (std::size_t i = 0; i < line.value.size(); ++i) {
    const double x_px = x(line.x[i]);
    if (!std::isfinite(line.value[i]) || x_px - last_px < 1) continue;  // one for each column of pixels
    last_px = x_px;
    fmt::format_to(std::back_inserter(out), "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"1.4\" style=\"fill:{}\"/>", x_px,
                   y(line.value[i]), line.colour);
  }
  return out;
}

std::string line_of(const PlotLine& line, const Scale& x, const Scale& y) {
  if (line.is_dots) return dots_of(line, x, y);
  Path path{x, y};
  for (std::size_t i = 0; i < line.value.size(); ++i) {
    if (std::isfinite(line.value[i])) {
      path.add(line.x[i], line.value[i]);
    } else {
      path.end_piece();
    }
  }
  return fmt::format("<path d=\"{}\" fill=\"none\" style=\"stroke:{}\" stroke-width=\"1.3\"{}/>", path.text(),
                     line.colour, line.is_dashed ? " stroke-dasharray=\"6 3\"" : "");
}

// Each piece is one outline: along the upper edge, and back along the lower one.
std::string band_of(const PlotBand& band, const Scale& x, const Scale& y) {
  std::string out, forth, back;
  double column_px = -1, low = 0, high = 0;
  const auto finish_column = [&] {
    if (column_px < 0) return;
    fmt::format_to(std::back_inserter(forth), "{}{:.1f} {:.1f}", forth.empty() ? 'M' : 'L', column_px, y(high));
    back = fmt::format("L{:.1f} {:.1f}", column_px, y(low)) + back;
    column_px = -1;
  };
  const auto finish_piece = [&] {
    finish_column();
    if (!forth.empty())
      out += fmt::format("<path d=\"{}{}Z\" style=\"fill:{}\" fill-opacity=\"0.18\"/>", forth, back, band.colour);
    forth.clear();
    back.clear();
  };
  for (std::size_t i = 0; i < band.low.size(); ++i) {
    if (!std::isfinite(band.low[i]) || !std::isfinite(band.high[i])) {
      finish_piece();
      continue;
    }
    const double x_px = std::floor(x(band.x[i])) + 0.5;
    if (x_px != column_px) {
      finish_column();
      column_px = x_px, low = band.low[i], high = band.high[i];
    }
    low = std::min(low, band.low[i]);
    high = std::max(high, band.high[i]);
  }
  finish_piece();
  return out;
}

std::string stretches_of(const Plot& plot, const Scale& x, const Scale& y) {
  std::string out;
  for (const PlotStretch& stretch : plot.stretches) {
    const double from_px = x(std::clamp(stretch.from, x.from, x.to)), to_px = x(std::clamp(stretch.to, x.from, x.to));
    out += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" style=\"{}\"/>", from_px,
                       y.end_px, to_px - from_px, y.begin_px - y.end_px, kStretchStyle);
  }
  return out;
}

// As many decimals as the distance of the ticks needs.
std::string tick_text(double value, double step) {
  const int decimals = std::clamp(static_cast<int>(-std::floor(std::log10(step))), 0, 9);
  return fmt::format("{:.{}f}", value == 0 ? 0.0 : value, decimals);
}

std::string axes_of(const Plot& plot, const Scale& x, const Scale& y) {
  std::string out;
  const auto add = std::back_inserter(out);
  const auto times = ticks_between(plot.x_from, plot.x_to, kTimeTicks);
  const double bottom_px = y.begin_px;
  for (const double time_s : times) {
    const double step = times.size() > 1 ? times[1] - times[0] : 1;
    fmt::format_to(add, "<path d=\"M{0:.1f} {1:.1f}V{2:.1f}\" class=\"grid\"/>", x(time_s), y.end_px, bottom_px);
    fmt::format_to(add, "<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{}</text>", x(time_s), bottom_px + 15,
                   tick_text(time_s, step));
  }
  const auto values = ticks_between(y.from, y.to, kValueTicks);
  for (const double value : values) {
    const double step = values.size() > 1 ? values[1] - values[0] : 1;
    fmt::format_to(add, "<path d=\"M{:.1f} {:.1f}H{:.1f}\" class=\"grid\"/>", x.begin_px, y(value), x.end_px);
    fmt::format_to(add, "<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text>", x.begin_px - 6, y(value) + 4,
                   tick_text(value, step));
  }
  fmt::format_to(add, "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" class=\"frame\"/>",
                 x.begin_px, y.end_px, x.end_px - x.begin_px, bottom_px - y.end_px);
  return out;
}

struct LegendEntry {
  std::string label, mark;
  double width_px() const {  // letters of UTF-8, of an average width
    constexpr double kLetter_px = 6.3, kMark_px = 24, kBetween_px = 14;
    const auto letters =
        std::ranges::count_if(label, [](char c) { return (static_cast<unsigned char>(c) & 0xC0) != 0x80; });
    return kMark_px + kLetter_px * static_cast<double>(letters) + kBetween_px;
  }
};

std::vector<LegendEntry> legend_entries(const Plot& plot) {
  std::vector<LegendEntry> entries;
  if (!plot.stretches.empty()) {
    entries.push_back(
        {plot.stretch_label, fmt::format("<rect y=\"-5\" width=\"18\" height=\"10\" style=\"{}\"/>", kStretchStyle)});
  }
  for (const PlotBand& band : plot.bands) {
    if (band.label.empty()) continue;
    entries.push_back({band.label, fmt::format("<rect y=\"-5\" width=\"18\" height=\"10\" style=\"fill:{}\" "
                                               "fill-opacity=\"0.25\"/>",
                                               band.colour)});
  }
  for (const PlotLine& line : plot.lines) {
    if (line.label.empty()) continue;
    const std::string stroke = fmt::format("<path d=\"M0 0H18\" style=\"stroke:{}\" stroke-width=\"1.6\"{}/>",
                                           line.colour, line.is_dashed ? " stroke-dasharray=\"6 3\"" : "");
    const std::string dot = fmt::format("<circle cx=\"9\" cy=\"0\" r=\"2\" style=\"fill:{}\"/>", line.colour);
    entries.push_back({line.label, line.is_dots ? dot : stroke});
  }
  return entries;
}

// To the right of the title where it fits there, else in rows of its own below it.
struct Legend {
  std::string text;
  int rows_below = 0;
};

Legend legend_of(const Plot& plot) {
  constexpr double kBaseline_px = 16, kTitleLetter_px = 7.2, kAfterTitle_px = 24;
  const std::vector<LegendEntry> entries = legend_entries(plot);
  double width_px = 0;
  for (const LegendEntry& entry : entries) width_px += entry.width_px();
  const double title_px = kTitleLetter_px * static_cast<double>(plot.title.size()) + kAfterTitle_px;
  const bool fits = title_px + width_px <= kPlotWidth_px;
  Legend legend;
  legend.rows_below = fits ? 0 : 1;
  double x_px = fits ? kLeft_px + kPlotWidth_px - width_px : kLeft_px;
  for (const LegendEntry& entry : entries) {
    if (!fits && x_px > kLeft_px && x_px + entry.width_px() > kLeft_px + kPlotWidth_px) {
      x_px = kLeft_px;
      ++legend.rows_below;
    }
    const double y_px = kBaseline_px + kRow_px * legend.rows_below;
    legend.text += fmt::format("<g transform=\"translate({:.1f} {:.1f})\">{}</g>", x_px, y_px - 4, entry.mark);
    legend.text += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\">{}</text>", x_px + 24, y_px, html_escaped(entry.label));
    x_px += entry.width_px();
  }
  return legend;
}

}  // namespace

std::vector<double> ticks_between(double low, double high, int count) {
  std::vector<double> ticks;
  if (!(high > low)) return ticks;
  const double rough = (high - low) / count;
  const double power = std::pow(10, std::floor(std::log10(rough)));
  double step = 10 * power;
  for (const double factor : {5.0, 2.0, 1.0}) {
    if (factor * power >= rough) step = factor * power;
  }
  for (double number = std::ceil(low / step); number * step <= high; ++number) ticks.push_back(number * step);
  return ticks;
}

std::string html_escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&': out += "&amp;"; break;
      case '<': out += "&lt;"; break;
      case '>': out += "&gt;"; break;
      case '"': out += "&quot;"; break;
      case '\'': out += "&#39;"; break;
      default: out += c;
    }
  }
  return out;
}

std::string svg_of(const Plot& plot) {
  const Legend legend = legend_of(plot);
  const double top_px = kTop_px + kRow_px * legend.rows_below;
  const double bottom_px = top_px + plot.height_px - kTop_px - kBottom_px;
  const double height_px = bottom_px + kBottom_px + (plot.x_title.empty() ? 0 : kRow_px);
  const double x_to = plot.x_to > plot.x_from ? plot.x_to : plot.x_from + 1;
  const Limits limits = limits_of(plot);
  const Scale x{plot.x_from, x_to, kLeft_px, kLeft_px + kPlotWidth_px};
  const Scale y{limits.low, limits.high, bottom_px, top_px};
  std::string out = fmt::format("<svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">", kWidth_px, height_px,
                                html_escaped(plot.title));
  out += axes_of(plot, x, y);
  out += fmt::format("<text x=\"{}\" y=\"16\" class=\"title\">{}</text>", kLeft_px, html_escaped(plot.title));
  out += legend.text;
  if (!plot.x_title.empty()) {
    out += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{}</text>", kLeft_px + kPlotWidth_px / 2,
                       bottom_px + kBottom_px + 8, html_escaped(plot.x_title));
  }
  out += stretches_of(plot, x, y);
  for (const PlotBand& band : plot.bands) out += band_of(band, x, y);
  for (const PlotLine& line : plot.lines) out += line_of(line, x, y);
  return out + "</svg>\n";
}

}  // namespace server::analysis
