// Reads whole files, of bounded size.
#include "server/cli/design/control_files.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "base/json_text.hpp"
#include "control/search/missed_ticks.hpp"
#include "server/analysis/control_json.hpp"
#include "server/analysis/motion_at_start.hpp"
#include "server/cli/terminal/input.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/output.hpp"
#include "server/storage/samples/position_sd.hpp"

namespace server::cli {
namespace {

constexpr std::size_t kMaxCsvBytes = 512 << 20;

[[noreturn]] void refuse(const std::string& file, const std::string& why) {
  throw std::runtime_error{fmt::format("{}: {}", file, why)};
}

template <class T>
T value_of(const std::string& file, const Result<T>& result) {
  if (!result) refuse(file, result.error().detail);
  return *result;
}

}  // namespace

void add_option(CLI::App& command, PlantChoice& choice) {
  command
      .add_option("--plant", choice.file,
                  "Model file {\"kp\":...,\"b1\":...,\"b2\":...,\"b3\":...,\"alpha\":...,\"beta\":...} with perhaps a "
                  "\"dead_time_s\", what identify --json printed, or newtonian or non_newtonian (default: "
                  "non_newtonian, the paper's (29))")
      ->check(named());
}

void add_option(CLI::App& command, ControllerChoice& choice) {
  command
      .add_option("--controller", choice.file,
                  "Controller file {\"kp\":...,\"kd\":...,\"mu\":...} (default: the paper's (30))")
      ->check(named());
}

Plant read(const PlantChoice& choice) {
  if (!choice.file || *choice.file == "non_newtonian") return {control::kNonNewtonianModel, {}, {}};
  if (*choice.file == "newtonian") return {control::kNewtonianModel, {}, {}};
  const std::string& file = *choice.file;
  const nlohmann::json document = read_json(file);
  return {value_of(file, analysis::model_from(document)), value_of(file, analysis::uncertainty_from(document)),
          value_of(file, analysis::doubts_from(document))};
}

void say_doubts(const PlantChoice& choice, const Plant& plant) {
  const std::string words = analysis::doubts_in_words(plant.doubts);
  if (!words.empty()) fmt::print(stderr, "rheonaut: warning: {}: {}\n", *choice.file, words);
}

void say_margin_sigmas(std::ostream& out, const PlantChoice& choice,
                       const std::optional<control::MarginUncertainty>& sigmas) {
  if (!choice.file || *choice.file == "newtonian" || *choice.file == "non_newtonian") return;
  if (!sigmas) {
    fmt::print(out, "the sigmas of the plant's parameters are not known: the margin takes them as exact\n");
    return;
  }
  fmt::print(out,
             "by the sigmas of the plant's fit (± 2 sd): phase margin ± {} deg, gain crossover ± {} rad/s, "
             "phase slope ± {} deg/(rad/s)\n",
             cell(2 * sigmas->phase_margin_deg, 2), cell(2 * sigmas->gain_crossover_rad_s, 2),
             cell(2 * sigmas->phase_slope_deg_per_rad_s, 2));
}

control::FopdController read(const ControllerChoice& choice) {
  if (!choice.file) return control::kPaperController;
  return value_of(*choice.file, analysis::controller_from(read_json(*choice.file)));
}

analysis::CsvColumns read_csv(const std::string& file, std::initializer_list<const char*> required,
                              std::initializer_list<const char*> optional,
                              std::initializer_list<const char*> with_gaps) {
  return analysis::parse_csv(read_text(file, kMaxCsvBytes), file, required, optional, with_gaps);
}

namespace {

constexpr const char* kPositionSd = "position_sd_m";

std::vector<double> times_of(const std::string& file, analysis::CsvColumns& columns) {
  if (columns.contains("t_s")) return columns["t_s"];
  if (!columns.contains("robot_time_us")) refuse(file, "has no column t_s (seconds)");
  std::vector<double> time_s = columns["robot_time_us"];
  const double began_us = time_s.empty() ? 0 : time_s.front();
  for (double& time : time_s) time = (time - began_us) / 1e6;
  return time_s;
}

// The decimals of an export stand for binary32.
void round_to_binary32(analysis::CsvColumns& columns) {
  for (auto& [name, values] : columns) {
    if (name == "t_s" || name == "robot_time_us") continue;
    for (double& value : values) value = static_cast<double>(static_cast<float>(value));
  }
}

// Whether there was one.
bool take_off_disturbance(analysis::CsvColumns& columns) {
  const auto disturbance = columns.find("disturbance_m"), position = columns.find("position_m");
  if (disturbance == columns.end() || position == columns.end()) return false;
  const std::vector<double>& disturbance_m = disturbance->second;
  std::vector<double>& position_m = position->second;
  for (std::size_t k = 0; k < std::min(disturbance_m.size(), position_m.size()); ++k) {
    if (std::isfinite(disturbance_m[k])) position_m[k] -= disturbance_m[k];
  }
  return true;
}

double largest_sd_m(const std::vector<double>& values_m) {
  double largest_m = 0;
  for (const double value_m : values_m) largest_m = storage::larger_sd_m(largest_m, value_m);
  return largest_m;
}

// Leaves the columns that are fitted.
std::string choose_channels(const std::string& file, analysis::CsvColumns& columns, bool with_velocity) {
  if (!columns.contains(kPositionSd)) {
    columns.erase("acceleration_m_s2");
    std::string reason = "the file has no column position_sd_m: what it holds is taken as measured";
    if (take_off_disturbance(columns)) reason += ", position_m less disturbance_m, which the robot adds to it";
    return reason;
  }
  const double position_sd_m = largest_sd_m(columns[kPositionSd]);
  if (storage::is_estimate(position_sd_m)) {
    if (!columns.contains("acceleration_m_s2")) {
      refuse(file, fmt::format("{}; but there is no column acceleration_m_s2. If the position was measured, delete the "
                               "column position_sd_m",
                               analysis::channels_reason(position_sd_m)));
    }
    columns.erase("position_m");
    columns.erase("velocity_m_s");
  } else {
    columns.erase("acceleration_m_s2");
    if (!with_velocity && columns.contains("position_m")) columns.erase("velocity_m_s");
    take_off_disturbance(columns);
  }
  return analysis::channels_reason(position_sd_m);
}

void refuse_gaps(const std::string& file, const analysis::CsvColumns& columns) {
  for (const char* name : {"position_m", "velocity_m_s", "acceleration_m_s2"}) {
    const auto column = columns.find(name);
    if (column == columns.end()) continue;
    const std::vector<double>& values = column->second;
    const auto gap = std::ranges::find_if(values, [](double value) { return std::isnan(value); });
    if (gap == values.end()) continue;
    refuse(file, fmt::format("value {} of column {} is empty; a column that is fitted needs every value",
                             gap - values.begin() + 1, name));
  }
}

// A missing row is a period that the robot skipped, unless the numbers of the samples tell that some were lost.
void refuse_lost_samples(const std::string& file, const analysis::CsvColumns& columns) {
  const auto column = columns.find("seq");
  if (column == columns.end()) return;
  const std::vector<double>& seq = column->second;
  for (std::size_t k = 1; k < seq.size(); ++k) {
    if (!(seq[k] - seq[k - 1] > 1)) continue;
    refuse(file, fmt::format("after seq {} follows seq {}: the samples between were lost, and their duty is not known; "
                             "cut the file there",
                             seq[k - 1], seq[k]));
  }
}

}  // namespace

analysis::RunRecording read_recording(const std::string& file, bool with_velocity) {
  analysis::CsvColumns columns =
      read_csv(file, {"duty"}, {"t_s", "robot_time_us"},
               {"position_m", "velocity_m_s", kPositionSd, "acceleration_m_s2", "disturbance_m", "seq"});
  const std::vector<double> time_s = times_of(file, columns);
  if (columns.contains(kPositionSd)) round_to_binary32(columns);
  const auto velocity = columns.find("velocity_m_s");
  const auto recorded_m_s = velocity == columns.end() ? std::vector<double>{} : velocity->second;
  analysis::RunRecording made{{}, choose_channels(file, columns, with_velocity), {}};
  const bool has_any = columns.contains("position_m") || columns.contains("velocity_m_s");
  if (!has_any && !columns.contains("acceleration_m_s2")) {
    refuse(file, "has neither position_m nor velocity_m_s; one of them is needed");
  }
  refuse_gaps(file, columns);
  refuse_lost_samples(file, columns);
  try {
    made.recording = control::make_recording(time_s, columns["duty"], columns["position_m"], columns["velocity_m_s"],
                                             columns["acceleration_m_s2"]);
  } catch (const std::invalid_argument& error) {
    refuse(file, error.what());
  }
  if (std::string missed = control::missed_ticks_in_words(made.recording); !missed.empty()) {
    made.warnings.push_back(std::move(missed));
  }
  if (auto moves = analysis::motion_at_start(made.recording, recorded_m_s)) made.warnings.push_back(std::move(*moves));
  return made;
}

}  // namespace server::cli
