// The program rheonaut-sim: a robot that dials a station, an experiment's prediction, the pump's profile, a bad
// network.
#include <CLI/CLI.hpp>
#include <iostream>

#include "sim_robot/predict.hpp"
#include "sim_robot/proxy_command.hpp"
#include "sim_robot/run_robot.hpp"
#include "sim_robot/world_options.hpp"

int main(int argc, char** argv) try {
  CLI::App app{
      "Simulated swimming robot: the firmware core in a simulated fluid, connected to a Rheonaut station.\n"
      "Example: rheonaut-sim --station 127.0.0.1:7700 --id sim-1"};
  sim_robot::SimulatedRobotConfig config;
  sim_robot::WorldOptions world;
  std::string station, boot_id;
  double mean_flow_m3_s = sim_robot::kPaperFlowM3S;
  bool json = false;
  int handshake_ms = 0;
  const auto add_motion = [&config, &world](CLI::App& to) {
    to.add_option("--duty-min", config.duty.min, "lowest duty of the motor, in [-1, 0]")->capture_default_str();
    to.add_option("--duty-max", config.duty.max, "highest duty of the motor, in (0, 1]")->capture_default_str();
    sim_robot::add_fluid(to, world);
  };
  add_motion(app);
  sim_robot::add_surroundings(app, world);
  app.add_option("--station", station, "ADDR:PORT of the station's robot door");
  app.add_option("--id", config.robot_id, "name of the robot, 1 to 31 of [a-z0-9_-]")->capture_default_str();
  app.add_option("--token", config.token, "enrolment token, at most 71 characters");
  app.add_option("--boot-id", boot_id, "fixed boot id in hexadecimal instead of a random one");
  app.add_option("--handshake-ms", handshake_ms, "as TLS on the robot's board: it dials at rest, and ticks are missed")
      ->check(CLI::Range(0, 30'000))
      ->capture_default_str();
  CLI::App* predict = app.add_subcommand("predict", "compute the closed-loop experiment and print what it measures");
  add_motion(*predict);
  predict->add_flag("--json", json, "as JSON");
  CLI::App* flow_csv = app.add_subcommand("flow-csv", "print one period of the flow for a pump controller");
  flow_csv->add_option("--mean-flow-m3-s", mean_flow_m3_s, "negative: backwards")->capture_default_str();
  sim_robot::ProxyCommand proxy{app};
  try {
    app.parse(argc, argv);
    if (proxy.chosen()) return proxy.run();
    if (flow_csv->parsed()) {
      sim_robot::write_flow_csv(std::cout, mean_flow_m3_s);
      return EXIT_SUCCESS;
    }
    config.world = sim_robot::world_of(world);
    sim_robot::check(config);
    if (predict->parsed()) {
      std::cout << sim_robot::predict(config, json);
      return EXIT_SUCCESS;
    }
    if (station.empty()) throw CLI::RequiredError("--station");
    config.boot_id = boot_id.empty() ? sim_robot::random_boot_id() : sim_robot::parse_boot_id(boot_id);
    return sim_robot::run_robot(config, sim_robot::parse_station_address(station), handshake_ms);
  } catch (const CLI::ParseError& error) {
    return app.exit(error);
  }
} catch (const std::exception& error) {
  std::cerr << "rheonaut-sim: " << error.what() << '\n';
  return EXIT_FAILURE;
}
