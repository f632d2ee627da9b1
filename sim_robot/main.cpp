// The program rheonaut-sim: simulated robots, scenarios, predictions of experiments, a pump's profile, a bad network.
#include <CLI/CLI.hpp>
#include <iostream>

#include "base/command_line/help.hpp"
#include "base/command_line/reference_flags.hpp"
#include "base/command_line/suggestion.hpp"
#include "base/failures/words.hpp"
#include "base/resource_signals.hpp"
#include "base/version.hpp"
#include "sim_robot/cli/flow_command.hpp"
#include "sim_robot/cli/play_command.hpp"
#include "sim_robot/cli/predict_command.hpp"
#include "sim_robot/cli/proxy_command.hpp"
#include "sim_robot/cli/pump_command.hpp"
#include "sim_robot/cli/replay_command.hpp"
#include "sim_robot/cli/run_command.hpp"
#include "sim_robot/cli/scenarios_command.hpp"

namespace {

constexpr const char* kExamples = R"(Examples:
  rheonaut-sim --data rheonaut-data                            one robot in the fabric softener, here
  rheonaut-sim --station 127.0.0.1:7070 --scenario bad_day     the same robot on a bad day
  rheonaut-sim --station 127.0.0.1:7070 --scenario mine.toml --faults 127.0.0.1:7400 --duration-s 60
  curl -H 'Content-Type: application/json' -d '{"fault":"electrode_offset","offset_mv":40,"for_s":5}' \
       http://127.0.0.1:7400/faults
  curl -H 'Content-Type: application/json' -d '{"fault":"reboot","cause":"brown_out","off_for_s":2}' \
       http://127.0.0.1:7400/faults                            also link_outage, clock_jump, block, …
  rheonaut-sim pump constant --mean-flow-m-s 0.04 --faults 127.0.0.1:7400  the pump of a robot that runs
  rheonaut-sim --station 127.0.0.1:7070 --robots 1000 --duration-s 60     a fleet, and what became of its samples
  rheonaut-sim replay --station 127.0.0.1:7070 --robots 5000              the same with recorded telemetry
  rheonaut-sim scenarios                                       which there are
  rheonaut-sim scenarios --show figure_7 > mine.toml           one to begin with
  rheonaut-sim play figure_7 > figure_7.csv                    in virtual time, with its script
  rheonaut-sim predict --fluid water                           what the closed loop will do
The keys of a scenario and the HTTP control: docs/scenarios.md; fleets: docs/fleet.md)";

const base::command_line::ManualSection kExitStatuses{
    "EXIT STATUS", {{"0", "done"}, {"1", "failed; of a fleet: samples are lost"}, {"2", "the command line is wrong"}}};

}  // namespace

int main(int argc, char** argv) try {
  base::ignore_resource_signals();
  CLI::App app{"Simulated swimming robot: the firmware core in a simulated world", "rheonaut-sim"};
  app.formatter(base::command_line::help_formatter());
  app.set_help_flag("-h,--help", "Print this help and exit");
  app.failure_message([](const auto* all, const auto& error) { return base::command_line::complaint(*all, error); });
  app.require_subcommand(0, 1);
  base::command_line::add_reference_flags(app, base::version(), {kExitStatuses});
  sim_robot::RunCommand run{app};
  sim_robot::ReplayCommand replay{app};
  sim_robot::ScenariosCommand scenarios{app};
  sim_robot::PlayCommand play{app};
  sim_robot::PredictCommand predict{app};
  sim_robot::FlowCommand flow{app};
  sim_robot::PumpCommand pump{app};
  sim_robot::ProxyCommand proxy{app};
  app.footer(kExamples);  // after the commands, which would inherit it
  try {
    app.parse(argc, argv);
    if (replay.chosen()) return replay.run();
    if (scenarios.chosen()) return scenarios.run();
    if (play.chosen()) return play.run();
    if (predict.chosen()) return predict.run();
    if (flow.chosen()) return flow.run();
    if (pump.chosen()) return pump.run();
    if (proxy.chosen()) return proxy.run();
    return run.run();
  } catch (const CLI::ParseError& error) {
    return base::command_line::answer(app, error);
  } catch (const std::invalid_argument& error) {  // a value that is not allowed
    std::cerr << "rheonaut-sim: " << error.what() << '\n';
    return base::command_line::kUsageError;
  }
} catch (const std::exception& error) {
  std::cerr << "rheonaut-sim: " << base::failures::words_of(error) << '\n';
  return EXIT_FAILURE;
}
