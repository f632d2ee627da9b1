// The command line, by CLI11.
#include "server/cli/command_line.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <type_traits>

#include "server/cli/terminal/options.hpp"

#ifndef RHEONAUT_VERSION
#error "RHEONAUT_VERSION comes from CMake"
#endif

namespace server::cli {
namespace {

constexpr const char* kNotWritten = "the answer could not be written; is the disk full?";

void add_options(CLI::App& command, config::ConfigFlags& flags) {
  const auto add = [&command](const char* name, auto& value, const char* meaning) {
    command.add_option(name, value, meaning)->check(named());
  };
  add("--config", flags.file, "Configuration file in TOML; deploy/rheonaut.toml documents every option");
  add("--data", flags.data_dir, "Folder of everything the station keeps (default: rheonaut-data)");
  add("--http", flags.http, "ADDR:PORT of the page and the API (default: 127.0.0.1:8080; port 0: any)");
  add("--robots", flags.robots, "ADDR:PORT where robots dial in (default: 127.0.0.1:7070; port 0: any)");
}

void add_options(CLI::App& command, Serve& line) {
  add_options(command, line.flags);
  command.footer("Example: rheonaut serve --data ~/lab --robots 127.0.0.1:7070");
}

void add_options(CLI::App& command, CheckConfig& line) {
  add_options(command, line.flags);
  command.footer("Example: rheonaut check-config --data ~/lab");
}

// A command whose options fill a T, which becomes the line.
template <class T>
void offer(CLI::App& app, const char* name, const char* purpose, CommandLine& line) {
  auto parsed = std::make_shared<T>();
  CLI::App* command = app.add_subcommand(name, purpose);
  add_options(*command, *parsed);
  command->callback([parsed, &line] { line = *parsed; });
}

// One line, also for what CLI11 says in two; a word that is no command is named.
std::string complaint(const CLI::App& app, const CLI::Error& error) {
  const auto chosen = app.get_subcommands();
  const auto unknown = app.remaining(false);
  std::string what = error.what();
  if (chosen.empty() && !unknown.empty() && !unknown.front().starts_with('-')) {
    what = fmt::format("there is no command '{}'", unknown.front());
  }
  // CLI11 puts "--name: " before what a validator says.
  if (const std::size_t colon = what.find(": must "); what.starts_with("--") && colon != std::string::npos) {
    what.erase(colon, 1);
  }
  const std::string command = chosen.empty() ? "" : chosen.front()->get_name() + " ";
  return fmt::format("rheonaut: {}; see rheonaut {}--help\n", one_line(what), command);
}

}  // namespace

CommandLine parse_command_line(int argc, char** argv) {
  CLI::App app{"Rheonaut, the ground station for small robots"};
  app.set_version_flag("--version", RHEONAUT_VERSION);
  app.require_subcommand(1);
  app.footer("Example: rheonaut serve --data ~/lab --robots 127.0.0.1:7070");
  app.failure_message([](const CLI::App* whole, const CLI::Error& error) { return complaint(*whole, error); });
  CommandLine line;
  offer<Serve>(app, "serve", "Run the station until SIGINT or SIGTERM", line);
  offer<CheckConfig>(app, "check-config", "Check a configuration and print what it means", line);
  offer<Certificate>(app, "certificate", "Make or renew the station's certificate for TLS", line);
  offer<Backup>(app, "backup", "Copy a station's database, also while it runs, and verify the copy", line);
  offer<Doctor>(app, "doctor", "Say what is wrong with a station, its machine and its data folder, and what to do",
                line);
  offer<SupportBundle>(app, "support-bundle", "Gather what helps others to help, without secrets, in one zip file",
                       line);
  offer<Restore>(app, "restore", "Make a backup the database of a new data folder", line);
  offer<UserCommand>(app, "user", "Users of a station: add, list, change, remove", line);
  offer<TokenCommand>(app, "token", "API tokens of a station: create, list, revoke", line);
  offer<RobotCommand>(app, "robot", "Robots of a station: enroll, list, revoke", line);
  offer<FluidCommand>(app, "fluid", "Fluids of a station and their models: list, model, remove-model", line);
  offer<JobCommand>(app, "job", "Computations of a station on its runs: begin, list, show, cancel", line);
  offer<DesignCommand>(app, "design", "Models and controllers that a station keeps: list, save, show, export, compare",
                       line);
  offer<MetricsQuestion>(app, "metrics", "Figures and steps of a run; several runs side by side, with their spread",
                         line);
  offer<CompareQuestion>(app, "compare", "Traces of several runs on one time axis, and their differences", line);
  offer<ImpedanceMapQuestion>(app, "impedance-map", "Impedance against position, with detections and deliveries", line);
  offer<ReportQuestion>(app, "report", "Save a run, or several beside each other, as an HTML file with plots", line);
  offer<CapsuleQuestion>(app, "capsule",
                         "Save a run as an .eln archive with samples, metrics, configuration and report", line);
  offer<Reproduce>(app, "reproduce", "Check the .eln archive of a run, and compute its metrics and plots again", line);
  offer<Model>(app, "model", "Show the motion models, compute the hydrodynamic one, fit the motor", line);
  offer<Bode>(app, "bode", "Crossover, margins and frequency response of the open loop", line);
  offer<Step>(app, "step", "Velocity and position after a step of duty, or any duty", line);
  offer<Identify>(app, "identify", "Find the model that fits a recording; plan an experiment", line);
  offer<EstimatorQuestion>(app, "estimator", "Turn a plant into the model of the robot's estimator", line);
  offer<Tune>(app, "tune", "Find the controller for a crossover and a phase margin", line);
  offer<Discretise>(app, "discretise", "Turn the controller into coefficients for the robot", line);
  offer<Export>(app, "export", "Write a recorded run as a file: CSV, MAT or SQLite", line);
  offer<ReferenceCommand>(app, "reference", "A run's position as it was measured from outside: import, show, remove",
                          line);
  offer<Predict>(app, "predict", "Predict a closed-loop experiment, beside a recorded one", line);
  offer<ProfileQuestion>(app, "profile", "List experiment profiles; check one and predict its runs", line);
  offer<ExperimentCommand>(
      app, "experiment", "Profiles that robots of a station perform: begin, list, show, pause, resume, abort, …", line);
  offer<Autotune>(app, "autotune",
                  "From an identification experiment to a verified controller on a robot, in one command", line);
  offer<Verify>(app, "verify", "Check a station's database and the certificates of its runs", line);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    const Answered answered{app.exit(error)};
    if (!std::cout.flush()) throw std::runtime_error{kNotWritten};
    return answered;
  }
  return line;
}

std::optional<int> answer(const CommandLine& line, std::ostream& out) {
  return std::visit(
      [&out](const auto& options) -> std::optional<int> {
        using T = std::decay_t<decltype(options)>;
        if constexpr (std::is_same_v<T, Serve>) {
          return std::nullopt;
        } else if constexpr (std::is_same_v<T, Answered>) {
          return options.exit_code;
        } else {
          std::ostringstream text;
          const int exit_code = run(options, text);
          out << text.view() << std::flush;
          if (!out) throw std::runtime_error{kNotWritten};
          return exit_code;
        }
      },
      line);
}

}  // namespace server::cli
