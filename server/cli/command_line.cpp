// The command line, by CLI11.
#include "server/cli/command_line.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <iostream>
#include <memory>
#include <set>
#include <sstream>
#include <stdexcept>
#include <type_traits>

#include "base/command_line/help.hpp"
#include "base/command_line/suggestion.hpp"
#include "base/version.hpp"
#include "server/cli/data/limited_child.hpp"
#include "server/cli/terminal/exit_status.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/runtime/log.hpp"
#include "server/storage/upkeep/restore.hpp"

namespace server::cli {
namespace {

// Who reads a pipe (`| head`) may have read enough; anything else that takes no text is a fault.
// errno was 0 before the answer.
void end_answer(std::ostream& out) {
  if (out.flush() || errno == EPIPE) return;
  throw std::runtime_error{"the answer could not be written; is the disk full?"};
}

void add_options(CLI::App& command, config::ConfigFlags& flags) {
  const auto add = [&command](const char* name, auto& value, const char* meaning) {
    command.add_option(name, value, meaning)->check(named());
  };
  add("--config", flags.file, "Configuration file in TOML; deploy/rheonaut.toml documents every option");
  add("--data", flags.data_dir, "Folder of everything the station keeps (default: rheonaut-data)");
  add("--http", flags.http, "ADDR:PORT of the page and the API (default: 127.0.0.1:8080; port 0: any)");
  add("--robots", flags.robots, "ADDR:PORT where robots dial in (default: 127.0.0.1:7070; port 0: any)");
  command.add_flag("--any-file-system", flags.any_file_system,
                   "Make a new store also on NFS, SMB or FAT, where it can be damaged");
}

void add_options(CLI::App& command, Serve& line) {
  add_options(command, line.flags);
  command.footer("Example: rheonaut serve --data ~/lab --robots 127.0.0.1:7070");
}

void add_options(CLI::App& command, CheckConfig& line) {
  add_options(command, line.flags);
  add_json_flag(command, line.form);
  command.footer("Example: rheonaut check-config --data ~/lab");
}

// A command whose options fill a T, which becomes the line, unless a command of its own has done so.
template <class T>
void offer(CLI::App& app, const char* name, const char* purpose, CommandLine& line) {
  auto parsed = std::make_shared<T>();
  CLI::App* command = app.add_subcommand(name, purpose);
  add_options(*command, *parsed);
  command->callback([parsed, &line] {
    if (std::holds_alternative<Answered>(line)) line = *parsed;
  });
}

// The headings of --help, in its order, and their commands.
const std::vector<std::pair<const char*, std::vector<std::string_view>>> kGroups{
    {"Running a station",
     {"serve", "demo", "check-config", "doctor", "support-bundle", "certificate", "backup", "restore", "verify"}},
    {"Robots", {"stop", "watch", "robot", "fluid"}},
    {"Experiments", {"profile", "experiment", "autotune"}},
    {"Recordings",
     {"export", "run", "reference", "metrics", "compare", "impedance-map", "report", "capsule", "reproduce", "job"}},
    {"Models and controllers",
     {"model", "bode", "step", "identify", "estimator", "tune", "discretise", "predict", "design"}},
    {"Accounts", {"login-link", "user", "token"}},
    {"This program", {"completion", "man"}}};

const std::set<std::string_view> kFileOptions{"answers", "config", "csv",   "duty-csv",  "motor-csv",
                                              "file",    "to",     "plant", "controller"};

void group(CLI::App& app) {
  for (const auto& [heading, names] : kGroups) {
    for (const std::string_view name : names) app.get_subcommand(std::string{name})->group(heading);
  }
}

// What stands for the values of options that name files or folders.
void name_values(CLI::App& command) {
  for (CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) {
      if (name == "data") option->type_name("FOLDER");
      if (kFileOptions.contains(name)) option->type_name("FILE");
    }
  }
  for (CLI::App* one : command.get_subcommands({})) name_values(*one);
}

// Every command answers --version, which only the program's own --help lists.
void add_version(CLI::App& command) {
  for (CLI::App* one : command.get_subcommands({})) {
    one->set_version_flag("--version", base::version())->group("");
    add_version(*one);
  }
}

template <class T>
int write_of_program(const T& options, std::ostream& out) {
  CLI::App app;
  CommandLine unused;
  define_command_line(app, unused);
  write(options, app, out);
  return 0;
}

}  // namespace

int run(const CompletionCommand& line, std::ostream& out) { return write_of_program(line, out); }
int run(const ManualCommand& line, std::ostream& out) { return write_of_program(line, out); }

void define_command_line(CLI::App& app, CommandLine& line) {
  app.name("rheonaut");
  app.description("Rheonaut, the ground station for small swimming robots");
  app.formatter(base::command_line::help_formatter());
  app.set_version_flag("--version", base::version(), "Print the version and exit");
  app.set_help_flag("-h,--help", "Print this help and exit");
  app.require_subcommand(1);
  app.failure_message(
      [](const CLI::App* whole, const CLI::Error& error) { return base::command_line::complaint(*whole, error); });
  offer<Serve>(app, "serve", "Run the station until SIGINT or SIGTERM", line);
  offer<Demo>(app, "demo", "Start a station and a simulated robot, and perform the paper's Figure 7", line);
  offer<StopCommand>(app, "stop", "Emergency stop of robots, or of all robots", line);
  offer<WatchCommand>(app, "watch", "Show the robots live in the terminal", line);
  offer<CheckConfig>(app, "check-config", "Check a configuration and print what it means", line);
  offer<Certificate>(app, "certificate", "Make or renew the station's certificate for TLS", line);
  offer<Backup>(app, "backup", "Copy a station's database, also while it runs, and verify the copy", line);
  offer<Doctor>(app, "doctor", "Say what is wrong with a station, its machine and its data folder, and what to do",
                line);
  offer<SupportBundle>(app, "support-bundle", "Gather what helps others to help, without secrets, in one zip file",
                       line);
  offer<Restore>(app, "restore", "Make a backup the database of a new data folder", line);
  offer<LoginLink>(app, "login-link", "Make a one-time link that signs a browser in", line);
  offer<UserCommand>(app, "user", "Users of a station: add, list, change, remove", line);
  offer<TokenCommand>(app, "token", "API tokens of a station: create, list, revoke", line);
  offer<RobotCommand>(app, "robot",
                      "Robots of a station: enrol, list, revoke, parameters, controller, fluid, reserve, …", line);
  offer<Commission>(*app.get_subcommand("robot"), "commission",
                    "The first hour with a robot: prove its stops, measure it, write a signed record", line);
  offer<FluidCommand>(app, "fluid", "Fluids of a station and their models: list, model, remove-model", line);
  offer<JobCommand>(app, "job", "Computations of a station on its runs: begin, list, show, file, cancel", line);
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
  offer<Export>(app, "export", "Write a recorded run as a file: CSV, MAT, SQLite or MCAP", line);
  offer<RunCommand>(app, "run", "Make a run final whose robot does not come back", line);
  offer<ReferenceCommand>(app, "reference",
                          "A run's position as it was measured from outside: import, show, export, remove", line);
  offer<Predict>(app, "predict", "Predict a closed-loop experiment, beside a recorded one", line);
  offer<ProfileQuestion>(app, "profile", "List experiment profiles; check one and predict its runs", line);
  offer<ExperimentCommand>(
      app, "experiment", "Profiles that robots of a station perform: begin, list, show, pause, resume, abort, …", line);
  offer<Autotune>(app, "autotune",
                  "From an identification experiment to a verified controller on a robot, in one command", line);
  offer<Verify>(app, "verify", "Check a station's database and the certificates of its runs", line);
  offer<CompletionCommand>(app, "completion", "Print the completion script for bash, zsh or fish", line);
  offer<ManualCommand>(app, "man", "Print a manual page", line);
  app.footer(
      "Each command explains itself: rheonaut COMMAND --help\n"
      "Example: rheonaut serve --data ~/lab --robots 127.0.0.1:7070\n"
      "Example: rheonaut stop --data ~/lab");
  group(app);
  name_values(app);
  add_version(app);
}

CommandLine parse_command_line(int argc, char** argv) {
  CLI::App app;
  CommandLine line;
  define_command_line(app, line);
  errno = 0;
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    const Answered answered{base::command_line::answer(app, error)};
    end_answer(std::cout);
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
          int exit_code = 0;
          try {
            // SAFETY: a stop prints its outcome before it looks for reasons.
            exit_code = run(options, std::is_same_v<T, StopCommand> ? out : text);
          } catch (const UsageError& error) {
            fmt::print(stderr, "rheonaut: {}\n", one_line(error.what()));
            return base::command_line::kUsageError;
          }
          errno = 0;
          out << text.view();
          end_answer(out);
          return exit_code;
        }
      },
      line);
}

namespace {

// The file that the command reads and that somebody else may have made.
std::optional<ForeignFile> foreign_file(const CommandLine& line) {
  if (const auto* archive = std::get_if<Reproduce>(&line)) return ForeignFile{archive->file, {}};
  if (const auto* backup = std::get_if<Restore>(&line)) {
    return ForeignFile{backup->from, storage::restore_draft(backup->data_dir)};
  }
  const auto* database = std::get_if<Verify>(&line);
  if (database != nullptr && database->file) return ForeignFile{*database->file, {}};
  const auto* reference = std::get_if<ReferenceCommand>(&line);
  const bool is_import = reference != nullptr && reference->act == ReferenceCommand::Act::import;
  return is_import ? std::optional{ForeignFile{reference->csv_file, {}}} : std::nullopt;
}

}  // namespace

std::optional<int> answer(const CommandLine& line) {
  if (const auto foreign = foreign_file(line)) {
    if (const auto exit_code = read_in_child(*foreign)) return exit_code;
  }
  if (!std::holds_alternative<Serve>(line)) runtime::start_log("info");  // on standard error; the other has the answer
  return answer(line, std::cout);
}

}  // namespace server::cli
