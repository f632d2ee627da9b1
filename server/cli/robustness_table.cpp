// One row per plant and range of duty.
#include "server/cli/robustness_table.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include "server/cli/output.hpp"

namespace server::cli {

void write_robustness(std::ostream& out, const control::RobustnessTable& robustness) {
  Table table{{"robustness", "duty", "step: settling (s)", "overshoot (%)", "error (mm)", "disturbance: settling (s)",
               "overshoot (%)", "error (mm)"}};
  for (const control::RobustnessRow& row : robustness.rows) {
    const auto settling = [](const control::StepMetrics& m) { return m.settling_s ? cell(*m.settling_s, 4) : "never"; };
    table.row({row.name, fmt::format("{:g} to {:g}", row.duty_min, row.duty_max), settling(row.step),
               fmt::format("{:.2f}", row.step.overshoot_percent),
               fmt::format("{:.2f}", 1e3 * row.step.steady_state_error_m), settling(row.disturbance),
               fmt::format("{:.2f}", row.disturbance.overshoot_percent),
               fmt::format("{:.2f}", 1e3 * row.disturbance.steady_state_error_m)});
  }
  out << '\n';
  table.write(out);
  fmt::print(out, "sd of the duty at rest per sd of the position's noise: {:.4g} 1/m\n",
             robustness.duty_sd_per_noise_sd);
}

}  // namespace server::cli
