// Reads the flags of a replay and starts it.
#include "sim_robot/cli/replay_command.hpp"

#include <cmath>
#include <iostream>
#include <stdexcept>

namespace sim_robot {
namespace {

constexpr double kRecordedS = 30;

}  // namespace

ReplayCommand::ReplayCommand(CLI::App& app)
    : command_(app.add_subcommand("replay", "load test: many robots that send recorded telemetry as their own")) {
  add_station(*command_, station_);
  command_->add_option("--robots", options_.robots, "how many")->check(CLI::Range(1, kMostRobots))->required();
  command_->add_option("--id", options_.id_prefix, "the robots are ID-1 to ID-N")->capture_default_str();
  command_->add_option("--token", token_, "enrolment token, the same for all");
  command_->add_option("--rate", rate_, "times the speed of the recording")->capture_default_str();
  command_->add_option("--frames", frames_, "file of delimited robot frames instead of a recording made now")
      ->check(CLI::ExistingFile);
  command_->add_option("--samples-per-frame", samples_per_frame_, "of the recording made now")
      ->check(CLI::Range(1, 25))
      ->capture_default_str();
  command_->add_option("--seed", seed_, "of the recording made now")->capture_default_str();
  command_->add_option("--duration-s", options_.duration_s, "end by itself after so long; 0: never")
      ->check(CLI::Range(0.0, 1e9))
      ->type_name("S");
  command_->add_option("--ledger", options_.ledger, "write at the end what each robot's ring gave up, as JSON lines");
  command_->add_flag("--json", options_.json, "rates and summary as JSON lines");
}

int ReplayCommand::run() {
  options_.station = station_address(station_);
  if (!std::isfinite(options_.duration_s)) throw std::invalid_argument("--duration-s: not a time");
  const Recording recording =
      frames_.empty() ? make_recording(kRecordedS, samples_per_frame_, seed_) : load_recording(frames_);
  return run_replay(options_, token_, recording, rate_, std::cout);
}

}  // namespace sim_robot
