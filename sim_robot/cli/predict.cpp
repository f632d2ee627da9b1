// Runs the experiment and writes down what it measured.
#include "sim_robot/cli/predict.hpp"

#include <iomanip>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>

#include "sim_robot/lab/experiment.hpp"

namespace sim_robot {
namespace {

using Json = nlohmann::ordered_json;

Json or_null(std::optional<double> value) { return value ? Json(*value) : Json(nullptr); }

void write_row(std::ostream& out, const char* name, const control::StepMetrics& metrics) {
  std::ostringstream settling;
  settling << std::fixed << std::setprecision(2);
  if (metrics.settling_s) {
    settling << *metrics.settling_s << " s";
  } else {
    settling << "never";
  }
  out << std::left << std::setw(28) << name << std::right << std::setw(12) << settling.str() << std::fixed
      << std::setprecision(2) << std::setw(11) << metrics.overshoot_percent << " %" << std::setw(11)
      << 1000 * metrics.steady_state_error_m << " mm\n";
}

std::string as_table(const robot_fw::DutyRange& duty, const ExperimentResult& result) {
  std::ostringstream out;
  out << "Predicted for a duty in [" << duty.min << ", " << duty.max << "]\n";
  out << "                                settling    overshoot  steady error\n";
  write_row(out, "step to 0.1 m", result.step);
  write_row(out, "disturbance of -0.05 m", result.disturbance);
  return out.str();
}

}  // namespace

std::string predict(SimulatedRobotConfig config, bool as_json) {
  config.world.imu.reset();
  const ExperimentResult result = run_experiment(config);
  if (!as_json) return as_table(config.duty, result);
  Json json;
  json["duty_min"] = config.duty.min;
  json["duty_max"] = config.duty.max;
  json["settling_s"] = or_null(result.step.settling_s);
  json["overshoot_percent"] = result.step.overshoot_percent;
  json["steady_state_error_m"] = result.step.steady_state_error_m;
  json["disturbance_settling_s"] = or_null(result.disturbance.settling_s);
  json["disturbance_overshoot_percent"] = result.disturbance.overshoot_percent;
  json["disturbance_steady_state_error_m"] = result.disturbance.steady_state_error_m;
  return json.dump(2) + "\n";
}

}  // namespace sim_robot
