// The program rheonaut-sim: one simulated robot that dials a station, or the prediction of an experiment.
#include <CLI/CLI.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/signal_set.hpp>
#include <csignal>
#include <iostream>

#include "sim_robot/predict.hpp"
#include "sim_robot/robot_client.hpp"

namespace {

// "host:port" or "[v6]:port".
sim_robot::StationAddress parse_address(const std::string& text) {
  const std::size_t colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0 || colon + 1 == text.size()) {
    throw CLI::ValidationError("--station", "'" + text + "' is not ADDR:PORT");
  }
  std::string host = text.substr(0, colon);
  if (host.front() == '[' && host.back() == ']') host = host.substr(1, host.size() - 2);
  const std::string port = text.substr(colon + 1);
  if (port.size() > 5 || port.find_first_not_of("0123456789") != std::string::npos || std::stoi(port) > 65535 ||
      std::stoi(port) == 0) {
    throw CLI::ValidationError("--station", "'" + port + "' is not a port");
  }
  return {host, port};
}

int run_robot(const sim_robot::SimulatedRobotConfig& config, const sim_robot::StationAddress& station) {
  boost::asio::io_context loop{1};
  const auto log = [](const std::string& line) { std::cout << "rheonaut-sim: " << line << std::endl; };
  sim_robot::RobotClient client{loop, config, station, log};
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
  std::string station, boot_id;
  bool json = false;
  const auto add_duty = [&config](CLI::App& to) {
    to.add_option("--duty-min", config.duty.min, "lowest duty of the motor, in [-1, 0]")->capture_default_str();
    to.add_option("--duty-max", config.duty.max, "highest duty of the motor, in (0, 1]")->capture_default_str();
  };
  add_duty(app);
  app.add_option("--station", station, "ADDR:PORT of the station's robot door");
  app.add_option("--id", config.robot_id, "name of the robot, 1 to 31 of [a-z0-9_-]")->capture_default_str();
  app.add_option("--token", config.token, "enrolment token, at most 71 characters");
  app.add_option("--boot-id", boot_id, "fixed boot id in hexadecimal instead of a random one");
  CLI::App* predict = app.add_subcommand("predict", "compute the closed-loop experiment and print what it measures");
  add_duty(*predict);
  predict->add_flag("--json", json, "as JSON");
  try {
    app.parse(argc, argv);
    sim_robot::check(config);
    if (predict->parsed()) {
      std::cout << sim_robot::predict(config.duty, json);
      return EXIT_SUCCESS;
    }
    if (station.empty()) throw CLI::RequiredError("--station");
    config.boot_id = boot_id.empty() ? sim_robot::random_boot_id() : sim_robot::parse_boot_id(boot_id);
    return run_robot(config, parse_address(station));
  } catch (const CLI::ParseError& error) {
    return app.exit(error);
  }
} catch (const std::exception& error) {
  std::cerr << "rheonaut-sim: " << error.what() << '\n';
  return EXIT_FAILURE;
}
