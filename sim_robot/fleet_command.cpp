// Reads the options of fleets and starts them.
#include "sim_robot/fleet_command.hpp"

#include <iostream>

namespace sim_robot {
namespace {

constexpr int kMostRobots = 50'000;  // beyond, one address has no ports left
constexpr double kRecordedS = 30;

}  // namespace

FleetCommand::FleetCommand(CLI::App& app) {
  robots_ = app.add_option("--robots", options_.robots, "a fleet of so many robots in this process, ID-1 to ID-N")
                ->check(CLI::Range(1, kMostRobots));
  add_shared(app);
  replay_ = app.add_subcommand("replay", "load test: many robots that send recorded telemetry as their own");
  replay_->add_option("--station", station_, "ADDR:PORT of the station's robot door")->required();
  replay_->add_option("--robots", options_.robots, "how many")->check(CLI::Range(1, kMostRobots))->required();
  replay_->add_option("--id", options_.id_prefix, "the robots are ID-1 to ID-N")->capture_default_str();
  replay_->add_option("--token", token_, "enrolment token, the same for all");
  replay_->add_option("--rate", rate_, "times the speed of the recording")->capture_default_str();
  replay_->add_option("--frames", frames_, "file of delimited robot frames instead of a recording made now")
      ->check(CLI::ExistingFile);
  replay_->add_option("--samples-per-frame", samples_per_frame_, "of the recording made now")
      ->check(CLI::Range(1, 25))
      ->capture_default_str();
  replay_->add_option("--seed", seed_, "of the recording made now")->capture_default_str();
  add_shared(*replay_);
}

void FleetCommand::add_shared(CLI::App& to) {
  to.add_option("--duration-s", options_.duration_s, "a fleet ends after so many seconds; 0: at Ctrl-C")
      ->check(CLI::Range(0.0, 1e9))
      ->capture_default_str();
  to.add_flag("--json", options_.json, "a fleet's rates and summary as JSON lines");
}

int FleetCommand::run(const std::string& station, const SimulatedRobotConfig& kind, bool id_is_given) {
  options_.station = parse_station_address(station);
  if (id_is_given) options_.id_prefix = kind.robot_id;
  return run_fleet(options_, kind, std::cout);
}

int FleetCommand::replay() {
  options_.station = parse_station_address(station_);
  const Recording recording =
      frames_.empty() ? make_recording(kRecordedS, samples_per_frame_, seed_) : load_recording(frames_);
  return run_replay(options_, token_, recording, rate_, std::cout);
}

}  // namespace sim_robot
