// `rheonaut estimator`.
#include "server/cli/design/estimator.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>

#include "server/analysis/control_json.hpp"
#include "server/analysis/optional_json.hpp"
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
  const Plant plant = read(question.plant);
  say_doubts(question.plant, plant);
  const control::EstimatorModel model = control::estimator_model(plant.model);
  const analysis::ModelDoubts& known = plant.doubts;
  if (question.form.is_json) {
    analysis::OrderedJson answer = analysis::json_of(model);
    answer["plant"] = analysis::json_of(plant.model);
    if (known.are_known) {
      answer["doubts"] = analysis::json_of(std::span{known.doubts});
      answer["widening"] = analysis::or_null(control::widening(known.doubts));
    } else if (known.is_of_fit) {
      answer["doubts"] = nullptr;  // not known: robots are sent it as assumed
    }
    write_json(out, answer);
  } else if (model.is_met) {
    write_parameters(out, model);
    const std::string grave = analysis::grave_doubts_in_words(known);
    fmt::print(out, "fit error {} % of the final velocity, from 10 ms to 60 s: the robot can use this model{}\n",
               fixed(100 * model.fit_error, 3),
               grave.empty()
                   ? ". It is in force once the robot is told, with model_confirmed = 1 in this fluid only."
                   : fmt::format(" as assumed only, with model_confirmed = 0, since it is in doubt: {}.", grave));
  }
  return model.is_met ? 0 : not_done(kInfeasible, "the robot cannot use a model of this plant: " + model.reason);
}

}  // namespace server::cli
