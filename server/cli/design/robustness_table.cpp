// One row per plant and range of duty.
#include "server/cli/design/robustness_table.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include "server/cli/terminal/output.hpp"

namespace server::cli {

void write_robustness(std::ostream& out, const control::RobustnessTable& robustness) {
  Table table{{"robustness", "duty", "stable", "step: settling (s)", "overshoot (%)", "error (mm)",
               "disturbance: settling (s)", "overshoot (%)", "error (mm)"}};
  for (const control::RobustnessRow& row : robustness.rows) {
    const auto settling = [](const control::StepMetrics& m) { return m.settling_s ? cell(*m.settling_s, 4) : "never"; };
    table.row({row.name, fmt::format("{:g} to {:g}", row.duty_min, row.duty_max),
               row.is_diverging ? "diverges"
               : row.is_stable  ? "yes"
                                : "no",
               settling(row.step), fixed(row.step.overshoot_percent, 2), fixed(1e3 * row.step.steady_state_error_m, 2),
               settling(row.disturbance), fixed(row.disturbance.overshoot_percent, 2),
               fixed(1e3 * row.disturbance.steady_state_error_m, 2)});
  }
  out << '\n';
  table.write(out);
  const auto& noise = robustness.duty_sd_per_noise_sd;
  fmt::print(out, "stable: the sampled loop without clamp\nsd of the duty at rest per sd of the position's noise: {}\n",
             noise ? cell(*noise, 4) + " 1/m" : "none, the loop is not stable");
}

}  // namespace server::cli
