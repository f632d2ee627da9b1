// One request; a table of bins, one of events, and the doubts.
#include "server/cli/analysis/impedance_map.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <limits>

#include "server/analysis/comparison/impedance_map.hpp"
#include "server/cli/accounts/station_client.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/progress.hpp"

namespace server::cli {
namespace {

using nlohmann::json;

constexpr const char* kDirections[] = {"forward", "backward"};
constexpr const char* kBinColumns[] = {"from_m", "count", "runs", "mean_mv", "sd_mv", "min_mv", "position_sd_m"};

std::string cell_of(const json& value, double factor = 1) {
  return value.is_number() ? cell(factor * value.get<double>(), 4) : "-";
}

void write_bins(const json& map, std::ostream& out) {
  Table table{{"direction", "from (m)", "samples", "mean (mV)", "sd (mV)", "min (mV)", "± 2 sd (m)"}};
  for (const char* direction : kDirections) {
    const json& bins = map.at(direction);
    for (std::size_t i = 0; i < bins.at("from_m").size(); ++i) {
      table.row({direction, fixed(bins.at("from_m")[i].get<double>(), 3), cell_of(bins.at("count")[i]),
                 cell_of(bins.at("mean_mv")[i]), cell_of(bins.at("sd_mv")[i]), cell_of(bins.at("min_mv")[i]),
                 cell_of(bins.at("position_sd_m")[i], 2)});
    }
  }
  table.write(out);
}

void write_events(const json& map, std::ostream& out) {
  if (map.at("events").empty()) return;
  out << '\n';
  Table table{{"event", "run", "at (s)", "position (m)", "± 2 sd (m)", "value", "<unit"}};
  for (const json& event : map.at("events")) {
    const auto kind = event.at("kind").get<std::string>();
    table.row({kind, fmt::format("{}", event.at("run_id").get<std::int64_t>()), cell_of(event.at("at_s")),
               cell_of(event.at("position_m")), cell_of(event.at("position_sd_m"), 2), cell_of(event.at("value")),
               kind == "delivery_ended" ? "s" : "mV"});
  }
  table.write(out);
}

void write_bins_as_rows(const json& map, std::ostream& out) {
  fmt::print(out, "direction,{}\n", fmt::join(kBinColumns, ","));
  for (const char* direction : kDirections) {
    const json& bins = map.at(direction);
    for (std::size_t i = 0; i < bins.at("from_m").size(); ++i) {
      out << direction;
      for (const char* name : kBinColumns) out << ',' << (bins.at(name)[i].is_null() ? "" : bins.at(name)[i].dump());
      out << '\n';
    }
  }
}

void write_map(const json& map, std::ostream& out) {
  write_bins(map, out);
  write_events(map, out);
  fmt::print(out, "\nposition: {}\n", fmt::join(map.at("position_sources").get<std::vector<std::string>>(), ", "));
  for (const json& warning : map.at("warnings")) fmt::print(out, "warning: {}\n", warning.get<std::string>());
}

}  // namespace

void add_options(CLI::App& command, ImpedanceMapQuestion& options) {
  command.add_option("run", options.runs, "The number of a run, or of several, at most 12")
      ->required()
      ->expected(1, 12)
      ->check(whole(1, std::numeric_limits<std::int64_t>::max()));
  command.add_option("--bin-mm", options.bin_mm, "Width of a bin of the position (default: 5)")
      ->check(whole(analysis::kNarrowestBinMm, analysis::kWidestBinMm));
  command.add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  add_timeout_option(command, options.timeout_s);
  add_json_and_csv_flags(command, options.form);
  command.footer("Example: rheonaut impedance-map 1 --bin-mm 10 --data lab");
}

int run(const ImpedanceMapQuestion& options, std::ostream& out) {
  const bool is_one = options.runs.size() == 1;
  const std::string of = is_one ? fmt::format("runs/{}/impedance-map?", options.runs.front())
                                : fmt::format("run-comparison/impedance-map?runs={}&", fmt::join(options.runs, ","));
  const std::string target = fmt::format("/api/v1/{}bin_mm={}", of, options.bin_mm);
  const Progress progress{"impedance-map: the station computes", options.form};
  const json answer = asked(StationClient{options.data_dir}.ask("GET", target, nullptr, timeout(options.timeout_s)));
  const json& map = is_one ? answer : answer.at("together");
  if (options.form.is_json) {
    fmt::print(out, "{}\n", answer.dump(2));
  } else if (options.form.is_csv) {
    write_bins_as_rows(map, out);
  } else {
    write_map(map, out);
  }
  return 0;
}

}  // namespace server::cli
