// Steps belong together by their cause and their size.
#include "server/cli/experiments/autotune_comparison.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "server/cli/terminal/output.hpp"

namespace server::cli {

using nlohmann::json;

namespace {

constexpr double kSameSize = 0.05;  // relative
constexpr const char* kMeasures[] = {"settling_s", "overshoot_percent", "rise_10_90_s", "steady_state_error_m"};

json measures_of(const json& step) {
  json out;
  for (const char* name : kMeasures) out[name] = step.value(name, json());
  return out;
}

bool is_of_size(const json& step, double size_m) {
  const double moved_m = step.at("target_m").get<double>() - step.at("start_m").get<double>();
  return std::abs(moved_m - size_m) <= kSameSize * std::abs(size_m);
}

json predicted_for(const json& step, const json& tuning) {
  if (!tuning.contains("predicted") || tuning.at("predicted").empty()) return nullptr;
  const json& predicted = tuning.at("predicted").front();
  const json& experiment = predicted.at("experiment");
  const auto cause = step.at("cause").get<std::string>();
  // After a disturbance the robot comes back from where it seems to be.
  if (cause == "setpoint" && is_of_size(step, experiment.at("setpoint_m").get<double>())) {
    return measures_of(predicted.at("step"));
  }
  if (cause == "disturbance" && is_of_size(step, -experiment.at("disturbance_m").get<double>())) {
    return measures_of(predicted.at("disturbance"));
  }
  return nullptr;
}

std::string number(const json& measures, const char* name, double factor, int decimals) {
  if (!measures.is_object() || !measures.at(name).is_number()) return "-";
  return fixed(factor * measures.at(name).get<double>(), decimals);
}

void add_row(Table& table, const std::string& name, const json& measures, const std::string& position) {
  constexpr double kMmPerM = 1e3;
  table.row({name, number(measures, "settling_s", 1, 2), number(measures, "overshoot_percent", 1, 2),
             number(measures, "rise_10_90_s", 1, 2), number(measures, "steady_state_error_m", kMmPerM, 2), position});
}

}  // namespace

json comparison_of(const json& metrics, const json& tuning) {
  json steps = json::array();
  for (const json& step : metrics.at("steps")) {
    steps.push_back({{"cause", step.at("cause")},
                     {"start_m", step.at("start_m")},
                     {"target_m", step.at("target_m")},
                     {"position_source", step.at("position_source")},
                     {"position_sd_m", step.at("position_sd_m")},
                     {"position_doubt", step.value("position_doubt", "")},
                     {"measured", measures_of(step)},
                     {"predicted", predicted_for(step, tuning)}});
  }
  return steps;
}

void write_comparison(std::ostream& out, const json& steps) {
  std::vector<std::string> doubts;
  Table table{{"step", "settling (s)", "overshoot (%)", "rise (s)", "error (mm)", "<position"}};
  for (const json& step : steps) {
    const std::string name = fmt::format("{} {:.4g} to {:.4g} m", step.at("cause").get<std::string>(),
                                         step.at("start_m").get<double>(), step.at("target_m").get<double>());
    const json& sd_m = step.at("position_sd_m");
    const std::string within = sd_m.is_number() ? fixed(2e3 * sd_m.get<double>(), 1) + " mm" : "not known";
    add_row(table, name + ", measured", step.at("measured"),
            fmt::format("{}, ± {}", step.at("position_source").get<std::string>(), within));
    add_row(table, name + ", predicted", step.at("predicted"), "");
    if (const auto doubt = step.value("position_doubt", std::string{}); !doubt.empty()) {
      doubts.push_back(name + ": " + doubt);
    }
  }
  table.write(out);
  for (const std::string& doubt : doubts) fmt::print(out, "{}\n", doubt);
}

}  // namespace server::cli
