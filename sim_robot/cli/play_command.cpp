// Prints what the station has received from the robot, boot by boot.
#include "sim_robot/cli/play_command.hpp"

#include <CLI/CLI.hpp>
#include <iostream>

#include "base/number_text.hpp"

namespace sim_robot {
namespace {

using Samples = std::map<std::uint64_t, ReceivedSample>;

void write_boot(std::ostream& out, const ScenarioRun& run, const Samples& samples, std::size_t boot) {
  for (const auto& [seq, sample] : samples) {
    std::string line;
    base::append_seconds(line, static_cast<std::int64_t>(sample.robot_time_us));
    for (const float value : {sample.position_m, sample.velocity_m_s, sample.acceleration_m_s2, sample.duty,
                              sample.impedance_mv, sample.reference_m, sample.position_sd_m}) {
      line += ',';
      base::append_float(line, value, "nan");
    }
    out << line << ',' << protocol::text(sample.mode) << ',' << protocol::text(sample.sub_state) << ',' << boot << ','
        << run.true_position_m(boot, sample.robot_time_us) << '\n';
  }
}

void write_csv(std::ostream& out, const ScenarioRun& run) {
  const ReceivedTelemetry& station = run.station();
  out << "t_s,position_m,velocity_m_s,acceleration_m_s2,duty,impedance_mv,reference_m,position_sd_m,mode,sub_state,"
         "boot,true_position_m\n";
  out.precision(9);
  std::size_t boot = 0;
  for (const Samples& samples : station.earlier_boots) write_boot(out, run, samples, ++boot);
  write_boot(out, run, station.samples, ++boot);
}

}  // namespace

PlayCommand::PlayCommand(CLI::App& app)
    : command_(app.add_subcommand("play", "run a scenario with its script in virtual time and print it as CSV")) {
  command_->add_option("scenario", scenario_, "a TOML file, or a name of those that `rheonaut-sim scenarios` lists")
      ->required();
  add_robot(*command_, robot_);
}

bool PlayCommand::chosen() const { return command_->parsed(); }

int PlayCommand::run() const {
  RobotOptions options = robot_;
  options.scenario = scenario_;
  ScenarioRun run{scenario_of(options), [](const std::string& line) { std::cerr << "rheonaut-sim: " << line << '\n'; }};
  run.run();
  write_csv(std::cout, run);
  return EXIT_SUCCESS;
}

}  // namespace sim_robot
