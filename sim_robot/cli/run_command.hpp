// `rheonaut-sim --data …` and `rheonaut-sim --station …`: one robot or a fleet in real time, with or without a
// scenario.
#pragma once

#include <string>

#include "sim_robot/cli/robot_options.hpp"
#include "sim_robot/cli/station_options.hpp"
#include "sim_robot/client/station_connection.hpp"

namespace sim_robot {

class RunCommand {
 public:
  explicit RunCommand(CLI::App& app);  // adds its flags to the program itself

  // Until SIGINT or SIGTERM, or the end of the duration; returns the exit status. Throws for wrong
  // arguments or a taken port.
  int run() const;

 private:
  int run_one(const Scenario& scenario, const StationAddress& station) const;
  int run_many(const Scenario& scenario, const StationAddress& station) const;

  RobotOptions robot_;
  StationOptions station_;
  int handshake_ms_ = 0;
  std::string faults_at_, truth_to_;
  bool faults_anywhere_ = false;
  int robots_ = 0;  // 0: one, without a fleet's summary
  bool json_ = false;
};

}  // namespace sim_robot
