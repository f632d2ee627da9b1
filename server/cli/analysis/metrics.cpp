// One request; a table of figures, and one of steps.
#include "server/cli/analysis/metrics.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <limits>

#include "server/cli/accounts/station_client.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/output.hpp"
#include "server/cli/terminal/progress.hpp"

namespace server::cli {
namespace {

using nlohmann::json;

std::string number_text(const json& value) { return value.is_number() ? cell(value.get<double>(), 5) : "-"; }

void write_run(const json& metrics, std::ostream& out) {
  Table figures{{"figure", "value"}};
  for (const auto& [name, value] : metrics.at("figures").items()) figures.row({name, number_text(value)});
  figures.write(out);
  if (metrics.at("steps").empty()) return;
  out << '\n';
  Table steps{{"step", "at (s)", "target (m)", "settling (s)", "overshoot (%)", "rise (s)", "error (m)", "± 2 sd (m)",
               "<position"}};
  for (const json& step : metrics.at("steps")) {
    const json& sd_m = step.at("position_sd_m");
    steps.row({step.at("cause"), number_text(step.at("at_s")), number_text(step.at("target_m")),
               number_text(step.at("settling_s")), number_text(step.at("overshoot_percent")),
               number_text(step.at("rise_10_90_s")), number_text(step.at("steady_state_error_m")),
               sd_m.is_number() ? cell(2 * sd_m.get<double>(), 3) : "not known", step.at("position_source")});
  }
  steps.write(out);
  for (const json& step : metrics.at("steps")) {
    if (const auto doubt = step.value("position_doubt", std::string{}); !doubt.empty()) {
      fmt::print(out, "{} at {} s: {}\n", step.at("cause").get<std::string>(), number_text(step.at("at_s")), doubt);
    }
  }
}

void write_metric_rows(const MetricsQuestion& options, const char* title, const char* missing, const json& rows,
                       std::ostream& out) {
  std::vector<std::string> head{title};
  for (const std::int64_t run : options.runs) head.push_back(fmt::format("run {}", run));
  for (const char* name : {"runs", "mean", "sd", "± 95 %", "limit"}) head.emplace_back(name);
  Table table{std::move(head)};
  for (const json& row : rows) {
    std::vector<std::string> cells{row.at("name")};
    for (const json& value : row.at("values")) cells.push_back(value.is_number() ? number_text(value) : missing);
    for (const char* name : {"runs", "mean", "sd", "confidence_half_width", "repeatability_limit"}) {
      cells.push_back(number_text(row.at(name)));
    }
    table.row(std::move(cells));
  }
  table.write(out);
}

void write_comparison(const MetricsQuestion& options, const json& compared, std::ostream& out) {
  write_metric_rows(options, "figure", "-", compared.at("figures"), out);
  std::size_t number = 0;
  for (const json& step : compared.at("steps")) {
    fmt::print(out, "\nstep {}, {}, by the position {}:\n", ++number, step.at("cause").get<std::string>(),
               fmt::join(step.at("position_source").get<std::vector<std::string>>(), ", "));
    write_metric_rows(options, "measure", "never", step.at("measures"), out);
    const auto doubts = step.value("position_doubt", std::vector<std::string>(options.runs.size()));
    for (std::size_t i = 0; i < doubts.size(); ++i) {
      if (!doubts[i].empty()) fmt::print(out, "run {}: {}\n", options.runs.at(i), doubts[i]);
    }
  }
  const auto differing = compared.at("differing_conditions").get<std::vector<std::string>>();
  if (differing.empty()) return;
  fmt::print(out, "\nnot the same in all runs, so the spread is not that of repeats: {}\n", fmt::join(differing, ", "));
}

}  // namespace

void add_options(CLI::App& command, MetricsQuestion& options) {
  command.add_option("run", options.runs, "The number of a run, or of several")
      ->required()
      ->expected(1, 50)
      ->check(whole(1, std::numeric_limits<std::int64_t>::max()));
  command.add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  add_timeout_option(command, options.timeout_s);
  command.add_flag("--json", options.json, "As JSON");
  command.footer("Example: rheonaut metrics 1 2 3 --data lab");
}

int run(const MetricsQuestion& options, std::ostream& out) {
  const bool is_one = options.runs.size() == 1;
  const std::string target = is_one ? fmt::format("/api/v1/runs/{}/metrics", options.runs.front())
                                    : fmt::format("/api/v1/run-comparison?runs={}", fmt::join(options.runs, ","));
  const Progress progress{"metrics: the station computes", OutputForm{.is_json = options.json}};
  const json answer = asked(StationClient{options.data_dir}.ask("GET", target, nullptr, timeout(options.timeout_s)));
  if (options.json) {
    fmt::print(out, "{}\n", answer.dump(2));
  } else if (is_one) {
    write_run(answer, out);
  } else {
    write_comparison(options, answer, out);
  }
  return 0;
}

}  // namespace server::cli
