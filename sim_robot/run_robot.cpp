// Runs a client until a signal.
#include "sim_robot/run_robot.hpp"

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/signal_set.hpp>
#include <csignal>
#include <iostream>

namespace sim_robot {

int run_robot(const SimulatedRobotConfig& config, const StationAddress& station, int handshake_ms) {
  boost::asio::io_context loop{1};
  const auto log = [](const std::string& line) { std::cout << "rheonaut-sim: " << line << std::endl; };
  RobotClient client{loop, config, station, log, std::chrono::milliseconds(handshake_ms)};
  boost::asio::co_spawn(loop, client.run(), [](const std::exception_ptr& error) {
    if (error) std::rethrow_exception(error);
  });
  boost::asio::signal_set stop{loop, SIGINT, SIGTERM};
  stop.async_wait([&loop](const boost::system::error_code&, int) { loop.stop(); });
  loop.run();
  return EXIT_SUCCESS;
}

}  // namespace sim_robot
