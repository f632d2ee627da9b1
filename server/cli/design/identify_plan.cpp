// `rheonaut identify --plan`: how exactly an experiment would determine the parameters.
#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <stdexcept>

#include "server/analysis/control_json.hpp"
#include "server/cli/design/identify.hpp"
#include "server/cli/terminal/exit_status.hpp"

namespace server::cli {
namespace {

constexpr double kMaxSamples = 200'000;

control::PlannedExperiment experiment_of(const Plan& plan, bool fits_offset) {
  if (!(plan.duration_s / plan.dt_s <= kMaxSamples)) {
    throw UsageError{fmt::format("--plan-duration-s {} at --plan-dt-s {} has more than {} samples", plan.duration_s,
                                 plan.dt_s, kMaxSamples)};
  }
  control::PlannedExperiment experiment;
  experiment.dt_s = plan.dt_s;
  experiment.duty = plan.duty == PlannedDuty::step
                        ? control::step_duty(plan.amplitude, plan.duration_s, plan.dt_s)
                        : control::prbs_duty(plan.amplitude, plan.bit_s, plan.duration_s, plan.dt_s);
  experiment.position_sd_m = plan.position_sd_m;
  experiment.velocity_sd_m_s = plan.velocity_sd_m_s;
  experiment.acceleration_sd_m_s2 = plan.acceleration_sd_m_s2;
  experiment.fits_offset = fits_offset;
  return experiment;
}

}  // namespace

const char* text(PlannedDuty value) { return value == PlannedDuty::step ? "step" : "prbs"; }

int run_plan(const Identify& options, std::ostream& out) {
  const control::FractionalModel plant = read(options.plant).model;
  const auto expected = control::expected_uncertainty(plant, experiment_of(options.plan, options.search.fits_offset));
  if (options.form.is_json) {
    analysis::OrderedJson answer = analysis::json_of(expected);
    answer["plant"] = analysis::json_of(plant);
    write_json(out, answer);
    return 0;
  }
  const control::FractionalModel model = control::normalised(plant);
  const std::array<double, control::kParameters> values{model.kp, model.b1, model.b2, model.alpha, model.beta};
  Table table{{"parameter", "value", "one sigma", "relative (%)"}};
  for (std::size_t i = 0; i < values.size(); ++i) {
    const auto& sigma = expected.one_sigma[i];
    table.row({control::kParameterNames[i], cell(values[i]), sigma ? cell(*sigma, 3) : "cannot tell",
               sigma ? cell(100 * *sigma / std::abs(values[i]), 3) : "-"});
  }
  fmt::print(out, "{} of {} s, amplitude {}, every {} s; noise sd {} m, {} m/s, {} m/s² (0: not recorded)\n\n",
             text(options.plan.duty), options.plan.duration_s, options.plan.amplitude, options.plan.dt_s,
             options.plan.position_sd_m, options.plan.velocity_sd_m_s, options.plan.acceleration_sd_m_s2);
  table.write(out);
  return 0;
}

}  // namespace server::cli
