// One request; two tables for people, a row for each moment as CSV.
#include "server/cli/analysis/compare.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <limits>

#include "server/analysis/comparison/aligned_runs.hpp"
#include "server/cli/accounts/station_client.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/progress.hpp"

namespace server::cli {
namespace {

using nlohmann::json;

// How far a trace is from that of the reference run.
struct Distance {
  double squares = 0, largest = 0, at_s = 0;
  std::size_t rows = 0;
};

Distance distance_of(const json& differences, const json& time_s) {
  Distance distance;
  for (std::size_t i = 0; i < differences.size(); ++i) {
    if (!differences[i].is_number()) continue;
    const auto value = differences[i].get<double>();
    distance.squares += value * value;
    ++distance.rows;
    if (std::abs(value) <= std::abs(distance.largest)) continue;
    distance.largest = value;
    distance.at_s = time_s[i].get<double>();
  }
  return distance;
}

void write_alignment(const json& compared, std::ostream& out) {
  Table table{{"run", "<name", "aligned at (s)", "uncertain (s)", "<position"}};
  for (const json& run : compared.at("runs")) {
    table.row({fmt::format("{}", run.at("run_id").get<std::int64_t>()), one_line(run.at("name").get<std::string>()),
               fixed(run.at("aligned_at_s").get<double>(), 2), fixed(run.at("uncertain_s").get<double>(), 2),
               run.at("position_source")});
  }
  table.write(out);
}

void write_distances(const json& compared, std::ostream& out) {
  fmt::print(out, "\ndifferences from run {}, every {} s:\n", compared.at("reference_run_id").get<std::int64_t>(),
             compared.at("grid_s").get<double>());
  Table table{{"run", "<channel", "rows", "rms", "largest", "at (s)"}};
  for (const json& run : compared.at("runs")) {
    if (run.at("differences").is_null()) continue;
    for (const auto& [channel, differences] : run.at("differences").items()) {
      const Distance distance = distance_of(differences, compared.at("time_s"));
      const double rms = std::sqrt(distance.squares / static_cast<double>(distance.rows));  // NaN: nothing in common
      table.row({fmt::format("{}", run.at("run_id").get<std::int64_t>()), channel, fmt::format("{}", distance.rows),
                 cell(rms, 4), cell(distance.largest, 4), fixed(distance.at_s, 2)});
    }
  }
  table.write(out);
}

// A column of the CSV: its name, and the array that it is.
std::vector<std::pair<std::string, const json*>> columns_of(const json& compared) {
  std::vector<std::pair<std::string, const json*>> columns;
  for (const json& run : compared.at("runs")) {
    const auto id = run.at("run_id").get<std::int64_t>();
    for (const auto& [name, trace] : run.at("traces").items()) {
      columns.emplace_back(fmt::format("run_{}_{}", id, name), &trace);
    }
    for (const char* name : {"position_sd_m", "own_position_m"}) {
      if (!run.at(name).is_null()) columns.emplace_back(fmt::format("run_{}_{}", id, name), &run.at(name));
    }
    if (run.at("differences").is_null()) continue;
    for (const auto& [name, trace] : run.at("differences").items()) {
      columns.emplace_back(fmt::format("run_{}_difference_{}", id, name), &trace);
    }
  }
  return columns;
}

void write_rows(const json& compared, std::ostream& out) {
  const auto columns = columns_of(compared);
  out << "time_s";
  for (const auto& [name, values] : columns) out << ',' << name;
  out << '\n';
  const json& time_s = compared.at("time_s");
  for (std::size_t i = 0; i < time_s.size(); ++i) {
    out << time_s[i].dump();
    for (const auto& [name, values] : columns) out << ',' << ((*values)[i].is_null() ? "" : (*values)[i].dump());
    out << '\n';
  }
}

}  // namespace

void add_options(CLI::App& command, CompareQuestion& options) {
  command.add_option("run", options.runs, "The numbers of 2 to 12 runs")
      ->required()
      ->expected(2, static_cast<int>(analysis::kMostAlignedRuns))
      ->check(whole(1, std::numeric_limits<std::int64_t>::max()));
  command.add_option("--channels", options.channels, "Names with commas between them (default: position_m,duty)")
      ->check(named());
  add_options(command, options.traces);
  command.add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  add_timeout_option(command, options.timeout_s);
  add_json_and_csv_flags(command, options.form);
  command.footer("Example: rheonaut compare 1 2 3 --at step --csv --data lab > steps.csv");
}

int run(const CompareQuestion& options, std::ostream& out) {
  const std::string target = fmt::format("/api/v1/run-comparison/traces?{}&channels={}",
                                         query_of(options.runs, options.traces), options.channels);
  const Progress progress{"compare: the station computes", options.form};
  const json compared = asked(StationClient{options.data_dir}.ask("GET", target, nullptr, timeout(options.timeout_s)));
  if (options.form.is_json) {
    fmt::print(out, "{}\n", compared.dump());
  } else if (options.form.is_csv) {
    write_rows(compared, out);
  } else {
    write_alignment(compared, out);
    write_distances(compared, out);
  }
  return 0;
}

}  // namespace server::cli
