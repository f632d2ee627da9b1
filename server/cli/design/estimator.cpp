// `rheonaut estimator`.
#include "server/cli/design/estimator.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>

#include "server/analysis/control_json.hpp"
#include "server/cli/design/tune.hpp"

namespace server::cli {
namespace {

void write_parameters(std::ostream& out, const control::EstimatorModel& model) {
  Table table{{"parameter of the robot", "value", "<unit"}};
  for (std::size_t i = 0; i < control::kEstimatorSections; ++i) {
    table.row({fmt::format("model_gain_{}_m_s", i + 1), fmt::format("{}", model.sections.gain_m_s[i]), "m/s"});
  }
  for (std::size_t i = 0; i < control::kEstimatorSections; ++i) {
    table.row(
        {fmt::format("model_time_constant_{}_s", i + 1), fmt::format("{}", model.sections.time_constant_s[i]), "s"});
  }
  table.write(out);
}

}  // namespace

void add_options(CLI::App& command, EstimatorQuestion& question) {
  add_option(command, question.plant);
  add_json_flag(command, question.form);
  command.footer(
      "Exit status 3: the robot's four sections cannot follow the plant; the answer says how near they come.\n"
      "Example: rheonaut estimator --plant non_newtonian");
}

int run(const EstimatorQuestion& question, std::ostream& out) {
  const control::FractionalModel plant = read(question.plant);
  const control::EstimatorModel model = control::estimator_model(plant);
  if (question.form.is_json) {
    analysis::OrderedJson answer = analysis::json_of(model);
    answer["plant"] = analysis::json_of(plant);
    write_json(out, answer);
  } else if (model.is_met) {
    write_parameters(out, model);
    fmt::print(out,
               "fit error {} % of the final velocity, from 10 ms to 60 s: the robot can use this model. It is in force "
               "once the robot is told, with model_confirmed = 1 in this fluid only.\n",
               fixed(100 * model.fit_error, 3));
  }
  return model.is_met ? 0 : not_done(kInfeasible, "the robot cannot use a model of this plant: " + model.reason);
}

}  // namespace server::cli
