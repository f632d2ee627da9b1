// The program rheonaut-sim: one simulated robot that dials a station, the prediction of an experiment, or a bad
// network.
#include <CLI/CLI.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/signal_set.hpp>
#include <csignal>
#include <iostream>

#include "sim_robot/predict.hpp"
#include "sim_robot/proxy_command.hpp"
#include "sim_robot/robot_client.hpp"

namespace {

int run_robot(const sim_robot::SimulatedRobotConfig& config, const sim_robot::StationAddress& station,
              int handshake_ms) {
  boost::asio::io_context loop{1};
  const auto log = [](const std::string& line) { std::cout << "rheonaut-sim: " << line << std::endl; };
  sim_robot::RobotClient client{loop, config, station, log, std::chrono::milliseconds(handshake_ms)};
  boost::asio::co_spawn(loop, client.run(), [](const std::exception_ptr& error) {
    if (error) std::rethrow_exception(error);
  });
  boost::asio::signal_set stop{loop, SIGINT, SIGTERM};
  stop.async_wait([&loop](const boost::system::error_code&, int) { loop.stop(); });
  loop.run();
  return EXIT_SUCCESS;
}

}  // namespace

int main(int argc, char** argv) try {
  CLI::App app{
      "Simulated swimming robot: the firmware core in a simulated fluid, connected to a Rheonaut station.\n"
      "Example: rheonaut-sim --station 127.0.0.1:7700 --id sim-1"};
  sim_robot::SimulatedRobotConfig config;
  std::string station, boot_id, sensor = "bno055";
  bool json = false;
  int handshake_ms = 0;
  const auto add_duty = [&config](CLI::App& to) {
    to.add_option("--duty-min", config.duty.min, "lowest duty of the motor, in [-1, 0]")->capture_default_str();
    to.add_option("--duty-max", config.duty.max, "highest duty of the motor, in (0, 1]")->capture_default_str();
  };
  add_duty(app);
  app.add_option("--station", station, "ADDR:PORT of the station's robot door");
  app.add_option("--id", config.robot_id, "name of the robot, 1 to 31 of [a-z0-9_-]")->capture_default_str();
  app.add_option("--token", config.token, "enrolment token, at most 71 characters");
  app.add_option("--boot-id", boot_id, "fixed boot id in hexadecimal instead of a random one");
  app.add_option("--sensor", sensor, "bno055: its accelerometer and the estimate; perfect: the true position")
      ->check(CLI::IsMember({"bno055", "perfect"}))
      ->capture_default_str();
  app.add_option("--seed", config.seed, "of the sensors' noise")->capture_default_str();
  app.add_option("--handshake-ms", handshake_ms, "as TLS on the robot's board: it dials at rest, and ticks are missed")
      ->check(CLI::Range(0, 30'000))
      ->capture_default_str();
  CLI::App* predict = app.add_subcommand("predict", "compute the closed-loop experiment and print what it measures");
  add_duty(*predict);
  predict->add_flag("--json", json, "as JSON");
  sim_robot::ProxyCommand proxy{app};
  try {
    app.parse(argc, argv);
    if (proxy.chosen()) return proxy.run();
    sim_robot::check(config);
    if (predict->parsed()) {
      std::cout << sim_robot::predict(config.duty, json);
      return EXIT_SUCCESS;
    }
    if (sensor == "bno055") config.imu.emplace();
    if (station.empty()) throw CLI::RequiredError("--station");
    config.boot_id = boot_id.empty() ? sim_robot::random_boot_id() : sim_robot::parse_boot_id(boot_id);
    return run_robot(config, sim_robot::parse_station_address(station), handshake_ms);
  } catch (const CLI::ParseError& error) {
    return app.exit(error);
  }
} catch (const std::exception& error) {
  std::cerr << "rheonaut-sim: " << error.what() << '\n';
  return EXIT_FAILURE;
}
