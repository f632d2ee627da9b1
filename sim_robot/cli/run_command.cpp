// Connects a robot, its faults and their server to one loop.
#include "sim_robot/cli/run_command.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <chrono>
#include <csignal>
#include <fstream>
#include <iostream>
#include <memory>

#include "base/invalid_argument.hpp"
#include "sim_robot/client/fault_server.hpp"
#include "sim_robot/client/robot_client.hpp"
#include "sim_robot/fleet/fleet_run.hpp"
#include "sim_robot/proxy/proxy.hpp"

namespace sim_robot {
namespace {

namespace asio = boost::asio;

constexpr int kNeverIn = 2;  // exit status, as of a fleet

// Beside a fleet's summary, which goes to standard output.
void say(const std::string& line) { std::cerr << "rheonaut-sim: " + line + '\n'; }

void spawn(asio::io_context& loop, asio::awaitable<void> task) {
  asio::co_spawn(loop, std::move(task), [](const std::exception_ptr& error) {
    if (error) std::rethrow_exception(error);
  });
}

void announce(const Scenario& scenario, bool has_network, const LinkLog& tell) {
  if (!scenario.name.empty()) tell("scenario " + scenario.name + ": " + scenario.description);
  if (!scenario.script.empty()) tell("its script is for `rheonaut-sim play`; here the station gives the commands");
  if (scenario.duration_s > 0) tell(base::join_text("ends by itself after ", scenario.duration_s, " s"));
  for (const TimedFault& timed : scenario.faults) {
    const std::string reason = why_not(timed.fault.kind, has_network);
    if (!reason.empty()) tell(base::join_text("at ", timed.at_s, " s will be passed over: ", reason));
  }
}

bool breaks_the_link(const Scenario& scenario) {
  return std::ranges::any_of(scenario.faults,
                             [](const TimedFault& timed) { return !why_not(timed.fault.kind, false).empty(); });
}

// Where the robot really is, each tick, for who compares it with the estimate while it runs.
class TruthFile {
 public:
  explicit TruthFile(const std::string& path) : out_(path) {
    if (!out_) throw std::invalid_argument("--truth: '" + path + "' cannot be written");
    out_.precision(9);
    out_ << "robot_time_us,true_position_m" << std::endl;
  }

  asio::awaitable<void> run(const RobotClient& client) {
    asio::steady_timer timer{co_await asio::this_coro::executor};
    for (std::uint64_t written_us = 0;;) {
      timer.expires_after(std::chrono::microseconds(SimulatedRobot::kPeriodUs));
      co_await timer.async_wait(asio::use_awaitable);
      const std::uint64_t now_us = client.robot().robot_time_us();
      if (now_us == written_us) continue;
      written_us = now_us;
      out_ << now_us << ',' << client.robot().world().position_m() << std::endl;
    }
  }

 private:
  std::ofstream out_;
};

// Of what a proxy says, that the station is not there, once; the time line says the faults.
LinkLog only_unreachable() {
  return [was_said = std::make_shared<bool>(false)](const std::string& line) {  // one for all connections
    if (*was_said || !line.starts_with("cannot reach")) return;
    *was_said = true;
    say(line.substr(0, line.find(": ")));
  };
}

// A network between robot and station, to be broken. The robot dials the address that this returns.
StationAddress put_between(std::optional<Proxy>& network, asio::io_context& loop, const StationAddress& station) {
  ProxyOptions options;
  options.target = station;
  network.emplace(loop, options, only_unreachable());
  spawn(loop, network->run());
  say(base::join_text("dials ", station.host, ":", station.port, " through ", network->endpoint(),
                      " in this process, which does the faults of the link"));
  return {"127.0.0.1", std::to_string(network->endpoint().port()), station.trust};
}

void stop_at_end(asio::io_context& loop, asio::signal_set& stop, asio::steady_timer& end, double duration_s) {
  stop.async_wait([&loop](const boost::system::error_code&, int) { loop.stop(); });
  if (duration_s <= 0) return;
  end.expires_after(std::chrono::microseconds(std::llround(duration_s * 1e6)));
  end.async_wait([&loop](const boost::system::error_code&) { loop.stop(); });
}

}  // namespace

RunCommand::RunCommand(CLI::App& app) {
  add_station(app, station_);
  app.add_option("--handshake-ms", handshake_ms_, "as TLS on the robot's board: it dials at rest, and ticks are missed")
      ->check(CLI::Range(0, 30'000))
      ->capture_default_str();
  app.add_option("--scenario", robot_.scenario, "a TOML file, or a name of those that `rheonaut-sim scenarios` lists");
  app.add_option("--token", robot_.token, "enrolment token, at most 71 characters");
  app.add_option("--faults", faults_at_, "ADDR:PORT to take faults at over HTTP while it runs; port 0: any")
      ->type_name("ADDR:PORT");
  app.add_flag("--faults-anywhere", faults_anywhere_, "allow an address beyond this machine; there is no password");
  app.add_option("--truth", truth_to_, "write the true position of each tick to this file, as CSV")->type_name("FILE");
  add_robot(app, robot_);
  auto* robots = app.add_option("--robots", robots_, "a fleet of so many in this process, ID-1 to ID-N, with a summary")
                     ->check(CLI::Range(1, kMostRobots))
                     ->excludes("--faults")
                     ->excludes("--truth")
                     ->excludes("--boot-id");
  app.add_flag("--json", json_, "a fleet's rates and summary as JSON lines")->needs(robots);
}

int RunCommand::run() const {
  const StationAddress station = station_address(station_);
  const Scenario scenario = scenario_of(robot_);
  return robots_ > 0 ? run_many(scenario, station) : run_one(scenario, station);
}

int RunCommand::run_many(const Scenario& scenario, const StationAddress& station) const {
  announce(scenario, false, say);
  FleetOptions fleet;
  fleet.station = station;
  fleet.robots = robots_;
  if (robot_.id) fleet.id_prefix = *robot_.id;
  fleet.duration_s = scenario.duration_s;
  fleet.json = json_;
  fleet.handshake = std::chrono::milliseconds(handshake_ms_);
  fleet.faults = scenario.faults;
  return run_fleet(fleet, scenario.robot, std::cout);
}

int RunCommand::run_one(const Scenario& scenario, const StationAddress& station) const {
  asio::io_context loop{1};
  std::optional<Proxy> network;  // of its own, only when it is to be broken
  const bool is_to_be_broken = !faults_at_.empty() || breaks_the_link(scenario);
  const StationAddress dialled = is_to_be_broken ? put_between(network, loop, station) : station;
  RobotClient client{loop,
                     scenario.robot,
                     dialled,
                     say,
                     std::chrono::milliseconds(handshake_ms_),
                     scenario.faults,
                     network ? &*network : nullptr};
  std::optional<FaultServer> server;
  if (!faults_at_.empty()) {
    server.emplace(loop, parse_faults_address(faults_at_, faults_anywhere_), client.faults(), client.faulty());
    say(base::join_text("faults at http://", server->address(), "/faults"));
    spawn(loop, server->run());
  }
  std::optional<TruthFile> truth;
  if (!truth_to_.empty()) spawn(loop, truth.emplace(truth_to_).run(client));
  announce(scenario, network.has_value(), say);
  spawn(loop, client.run());
  asio::signal_set stop{loop, SIGINT, SIGTERM};
  asio::steady_timer end{loop};
  stop_at_end(loop, stop, end, scenario.duration_s);
  loop.run();
  if (client.connection().counts().welcomes > 0) return EXIT_SUCCESS;
  say("no station has taken it in");
  return kNeverIn;
}

}  // namespace sim_robot
