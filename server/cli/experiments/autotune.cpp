// Options, the chain, and its answer.
#include "server/cli/experiments/autotune.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <fstream>
#include <iostream>
#include <limits>

#include "server/cli/design/tune.hpp"
#include "server/cli/experiments/autotune_comparison.hpp"
#include "server/cli/experiments/profile_file.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/output.hpp"
#include "server/experiments/three_tones_document.hpp"

namespace server::cli {

using nlohmann::json;

namespace {

// Of the shipped identification set: the second PRBS and the rest before it are for validation.
constexpr const char* kIdentificationSet = "identification_set";
constexpr double kSecondPrbsFrom_s = 129;

AutotuneRequest request_of(const Autotune& options) {
  AutotuneRequest request = options.request;
  request.search = given_of(options.search);
  request.profile = profile_document(options.profile);
  if (request.is_model_free && options.profile == kIdentificationSet) {
    request.profile = experiments::three_tones_document(request.crossover_rad_s, options.tone_amplitude_m);
  }
  request.verify_profile = profile_document(options.verify_profile);
  const bool is_shipped_set = !request.run && !request.is_model_free && options.profile == kIdentificationSet;
  if (is_shipped_set && !request.fit_to_s && !request.validation_from_s) {
    request.fit_to_s = request.validation_from_s = kSecondPrbsFrom_s;
  }
  return request;
}

void write_offer(std::ostream& out, const json& tuning) {
  fmt::print(out, "not feasible: {}\n", tuning.at("reason").get<std::string>());
  Table table{{"crossover (rad/s)", "margin (deg)", "kp", "kd", "mu", "<what is near"}};
  bool has_any = false;
  for (const char* list : {"nearest_all", "relaxed"}) {
    for (const json& offer : tuning.value(list, json::array())) {
      has_any = true;
      table.row({cell(offer.at("crossover_rad_s").get<double>(), 5),
                 cell(offer.at("phase_margin_deg").get<double>(), 5), cell(offer.at("kp").get<double>()),
                 cell(offer.at("kd").get<double>()), cell(offer.at("mu").get<double>()),
                 offer.at("name").get<std::string>()});
    }
  }
  if (has_any) table.write(out);
}

const char* text_of(AutotuneEnd end) {
  switch (end) {
    case AutotuneEnd::done: return "done";
    case AutotuneEnd::infeasible: return "infeasible";
    case AutotuneEnd::stopped: return "stopped";
  }
  return "";
}

void write_end(const Autotune& options, const AutotuneState& state, const AutotuneChain& chain, AutotuneEnd end,
               std::ostream& out) {
  if (options.json) {
    json answer = state.document();
    answer["end"] = text_of(end);
    answer["tuning"] = chain.tuning();
    fmt::print(out, "{}\n", answer.dump(2));
  } else if (end == AutotuneEnd::done) {
    write_comparison(out, state.of("comparison").at("steps"));
    fmt::print(out, "`rheonaut robot controller {} --restore` brings the controller before back\n",
               options.request.robot_id);
  } else if (end == AutotuneEnd::infeasible) {
    write_offer(out, chain.tuning());
  }
}

void add_experiments(CLI::App& command, Autotune& options) {
  auto* profile = command
                      .add_option("--profile", options.profile,
                                  "Of the identification: a shipped profile, or a file in TOML or JSON (default: "
                                  "identification_set)")
                      ->check(named());
  command.add_option("--run", options.request.run, "Instead of an experiment, this recorded run")
      ->check(whole(1, std::numeric_limits<std::int64_t>::max()))
      ->excludes(profile);
  command.add_option("--fit-to-s", options.request.fit_to_s, "Fit the run up to here (default: to its end)")
      ->check(positive());
  command
      .add_option("--validation-from-s", options.request.validation_from_s,
                  "Try the model on the run from here on, which must be at rest (default: not tried)")
      ->check(positive());
  auto* model_free = command.add_flag("--model-free", options.request.is_model_free,
                                      "Find the controller from three tones in closed loop, without a model");
  command.add_option("--tone-amplitude-m", options.tone_amplitude_m, "Of the setpoint, each tone (default: 0.02)")
      ->check(from_to(1e-4, 1))
      ->needs(model_free);
  for (const char* of_a_model : {"--fit-to-s", "--validation-from-s"}) model_free->excludes(of_a_model);
  command
      .add_option("--verify-profile", options.verify_profile,
                  "Of the closed loop: a shipped profile, or a file in TOML or JSON (default: figure_7)")
      ->check(named());
}

}  // namespace

void add_options(CLI::App& command, Autotune& options) {
  command.add_option("--robot", options.request.robot_id, "The robot")->required()->check(named());
  command.add_option("--crossover-rad-s", options.request.crossover_rad_s, "Gain crossover")
      ->required()
      ->check(crossovers());
  command.add_option("--phase-margin-deg", options.request.phase_margin_deg, "Phase margin")
      ->required()
      ->check(margins());
  command.add_option("--mu", options.request.mu, "Order of the derivative, which gives up iso-damping")->check(mus());
  add_experiments(command, options);
  add_search(command, options.search);
  for (const char* searching :
       {"--structure", "--cost", "--offset", "--dead-time-s", "--sensor-lag-s", "--time-limit-s"}) {
    command.get_option(searching)->excludes("--model-free");
  }
  command.add_option("--resume", options.resume, "Keep what is done in this file, and go on from it if it exists")
      ->check(named());
  command.add_flag("--confirm", options.request.confirm,
                   "The controller may have a wider duty range than the one in force");
  command
      .add_flag("--store-fluid-model", options.request.stores_fluid_model,
                "Keep the model as that of the robot's fluid: other robots get it when they are put into it")
      ->excludes("--model-free");
  command.add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  command.add_flag("--json", options.json, "As JSON");
  command.footer(
      "Exit status 3: nothing meets the specification; what comes near is printed. 5: an experiment was aborted, a "
      "job\n"
      "failed, or the robot did not report the controller or the model. With --resume the same command goes on from\n"
      "there.\n"
      "Example: rheonaut autotune --robot sim-1 --crossover-rad-s 3 --phase-margin-deg 90 --resume tune.json --data "
      "lab");
}

int run(const Autotune& options, const AskStation& ask, std::ostream& out, std::ostream& progress) {
  const AutotuneRequest request = request_of(options);
  AutotuneState state{options.resume, fixed_request(request)};
  AutotuneChain chain{ask, request, state, progress};
  const AutotuneEnd end = chain.run();
  write_end(options, state, chain, end, out);
  switch (end) {
    case AutotuneEnd::done: return 0;
    case AutotuneEnd::infeasible: return not_done(kNothingMeetsIt, "no controller meets the specification");
    case AutotuneEnd::stopped: break;
  }
  return not_done(kStageEnded, "autotune has stopped at a stage that did not end well");
}

int run(const Autotune& options, std::ostream& out) {
  const StationClient station{options.data_dir};
  const auto ask = [&station](const std::string& method, const std::string& target, const json& body) {
    return station.ask(method, target, body);
  };
  return run(options, ask, out, std::cerr);
}

}  // namespace server::cli
