// The API counts in whole micro- and milliseconds.
#include "server/cli/analysis/trace_options.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <cctype>
#include <cmath>
#include <limits>

#include "server/cli/terminal/options.hpp"

namespace server::cli {
namespace {

constexpr double kLongest_s = 86'400;

std::string encoded(const std::string& text) {
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    const bool is_plain = std::isalnum(byte) != 0 || c == '-' || c == '_' || c == '.';
    out += is_plain ? std::string{c} : fmt::format("%{:02X}", byte);
  }
  return out;
}

}  // namespace

void add_options(CLI::App& command, TraceOptions& options) {
  add_word(command, "--at", options.at, analysis::kAlignments,
           "Where runs are aligned: start, step, disturbance, event or marker (default: start)");
  command.add_option("--number", options.number, "The n-th step, disturbance, event or marker (default: 1)")
      ->check(whole(1, analysis::kMostAlignmentNumber));
  command.add_option("--event", options.event, "The kind of the event, e.g. detection")->check(named());
  command.add_option("--marker", options.marker, "The text of the marker (default: any)")->check(named());
  command.add_option("--from-s", options.from_s, "Only from so long after the alignment on; negative: before")
      ->check(from_to(-kLongest_s, kLongest_s));
  command.add_option("--to-s", options.to_s, "Only until so long after the alignment")
      ->check(from_to(-kLongest_s, kLongest_s));
  command.add_option("--grid-s", options.grid_s, "Distance of rows (default: 0.01, or as coarse as needed)")
      ->check(from_to(0.01, 60));
  command.add_option("--reference", options.reference, "The run from which differences are taken (default: the first)")
      ->check(whole(1, std::numeric_limits<std::int64_t>::max()));
}

std::string query_of(const std::vector<std::int64_t>& runs, const TraceOptions& options) {
  std::string query = fmt::format("runs={}&at={}&number={}", fmt::join(runs, ","), text(options.at), options.number);
  const auto add_scaled = [&](const char* name, const std::optional<double>& value, double scale) {
    if (value) query += fmt::format("&{}={}", name, std::llround(*value * scale));
  };
  if (!options.event.empty()) query += "&event=" + encoded(options.event);
  if (!options.marker.empty()) query += "&marker=" + encoded(options.marker);
  add_scaled("grid_us", options.grid_s, 1e6);
  add_scaled("from_ms", options.from_s, 1e3);
  add_scaled("to_ms", options.to_s, 1e3);
  if (options.reference) query += fmt::format("&reference_run_id={}", *options.reference);
  return query;
}

}  // namespace server::cli
