// Makes the robots, watches them, and reports.
#include "sim_robot/fleet/fleet_run.hpp"

#include <sys/resource.h>

#include <algorithm>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <csignal>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <ostream>
#include <stdexcept>

#include "sim_robot/client/robot_client.hpp"
#include "sim_robot/fleet/fleet.hpp"
#include "sim_robot/fleet/fleet_report.hpp"
#include "sim_robot/fleet/replayed_robot.hpp"

namespace sim_robot {
namespace {

namespace asio = boost::asio;
using Clock = FleetMember::Clock;
using namespace asio::experimental::awaitable_operators;  // NOLINT: operators only

constexpr rlim_t kOtherFiles = 32;
constexpr auto kSettle = std::chrono::seconds(5);
constexpr auto kLook = std::chrono::milliseconds(50);

// Each robot needs a socket; the soft limit is 1024 on many machines.
void allow_sockets(int robots) {
  rlimit limit{};
  getrlimit(RLIMIT_NOFILE, &limit);
  const rlim_t wanted = static_cast<rlim_t>(robots) + kOtherFiles;
  if (limit.rlim_cur >= wanted) return;
  if (limit.rlim_max < wanted) {
    throw std::invalid_argument("--robots: " + std::to_string(robots) + " robots need " + std::to_string(wanted) +
                                " open files, this process may have " + std::to_string(limit.rlim_max) +
                                "; raise it with ulimit -Hn");
  }
  limit.rlim_cur = wanted;
  setrlimit(RLIMIT_NOFILE, &limit);
}

// Says what keeps robots out, each thing once; on standard error, since standard output has results only.
class LinkNews {
 public:
  explicit LinkNews(const FleetOptions& options) : options_(options) {}

  void tell(const FleetCounts& counts) {
    if (options_.json) return;  // the counts are in every line
    const bool is_away = counts.connected == 0 && counts.links.unreachable > before_.links.unreachable;
    if (is_away && !was_away_) {
      std::cerr << "rheonaut-sim: cannot reach the station at " << options_.station.host << ':' << options_.station.port
                << ", trying again" << std::endl;
    }
    if (counts.links.refusals > 0 && before_.links.refusals == 0) {
      std::cerr << "rheonaut-sim: the station refuses robots: " << counts.refusal << std::endl;
    }
    if (is_away || counts.connected > 0) was_away_ = is_away;
    before_ = counts;
  }

 private:
  const FleetOptions& options_;
  FleetCounts before_;
  bool was_away_ = false;
};

// The fleet since it began.
struct Watch {
  const FleetOptions& options;
  const Fleet& fleet;
  std::ostream& out;
  const Lateness* acknowledged_after = nullptr;
  Clock::time_point start = Clock::now();
  double cpu_at_start_s = process_cpu_s();

  FleetSnapshot now() const {
    const double time_s = std::chrono::duration<double>(Clock::now() - start).count();
    return {time_s, process_cpu_s() - cpu_at_start_s, fleet.counts(), 0, acknowledged_after};
  }
};

asio::awaitable<void> report_rates(const Watch& watch) {
  asio::steady_timer timer{co_await asio::this_coro::executor};
  LinkNews news{watch.options};
  FleetSnapshot before;
  for (;;) {
    const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(Clock::now() - watch.start);
    timer.expires_at(watch.start + seconds + std::chrono::seconds(1));
    co_await timer.async_wait(asio::use_awaitable);
    const FleetSnapshot now = watch.now();
    news.tell(now.counts);
    watch.out << (watch.options.json ? rates_json : rates_text)(before, now, watch.fleet.lateness()) << std::endl;
    before = now;
  }
}

// What was made up to the end by robots that got in. They go on meanwhile, for they send whole frames.
class Rest {
 public:
  explicit Rest(const Fleet& fleet) : fleet_(fleet) {
    for (std::size_t i = 0; i < fleet.size(); ++i) at_end_.push_back(fleet.robot(i).samples());
  }
  // Neither acknowledged nor lost by now.
  std::uint64_t unsettled() const {
    std::uint64_t sum = 0;
    for (std::size_t i = 0; i < at_end_.size(); ++i) {
      const SampleCounts now = fleet_.robot(i).samples();
      const bool got_in = fleet_.robot(i).connection().counts().welcomes > 0;
      sum += got_in ? at_end_[i].made - std::min(at_end_[i].made, now.made - now.held) : 0;
    }
    return sum;
  }
  // Lost since the end: the oldest go first, so it is these.
  std::uint64_t lost() const {
    std::uint64_t sum = 0;
    for (std::size_t i = 0; i < at_end_.size(); ++i) {
      sum += std::min(fleet_.robot(i).samples().lost - at_end_[i].lost, at_end_[i].held);
    }
    return sum;
  }

 private:
  const Fleet& fleet_;
  std::vector<SampleCounts> at_end_;
};

// The duration and its end, or a signal; then up to kSettleS for the rest, or another signal.
asio::awaitable<FleetSnapshot> last(const Watch& watch, asio::io_context& loop) {
  asio::signal_set stop{loop, SIGINT, SIGTERM};
  asio::steady_timer end{loop, Clock::time_point::max()};
  if (watch.options.duration_s > 0) {
    end.expires_after(
        std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(watch.options.duration_s)));
  }
  auto either = end.async_wait(asio::use_awaitable) || stop.async_wait(asio::use_awaitable);
  co_await std::move(either);
  FleetSnapshot last = watch.now();
  const Rest rest{watch.fleet};
  const auto is_stopped = std::make_shared<bool>(false);
  stop.async_wait([is_stopped](const boost::system::error_code& error, int) { *is_stopped = !error; });
  const auto give_up_at = Clock::now() + kSettle;
  while (last.counts.links.opened > 0 && !*is_stopped && rest.unsettled() > 0 && Clock::now() < give_up_at) {
    co_await pause(kLook);
  }
  last.unsettled = rest.unsettled();
  last.counts.samples.lost += rest.lost();
  co_return last;
}

int report_end(const Watch& watch, const FleetSnapshot& end) {
  const auto fault = fleet_fault(end);
  const std::string reason = fault ? fault->reason : "";
  watch.out << (watch.options.json ? summary_json : summary_text)(end, watch.fleet.lateness(), reason) << std::flush;
  return fault ? fault->exit_status : EXIT_SUCCESS;
}

int run(const FleetOptions& options, asio::io_context& loop, Fleet& fleet, std::ostream& out,
        const Lateness* acknowledged_after = nullptr) {
  const Watch watch{options, fleet, out, acknowledged_after};
  const auto rethrow = [](const std::exception_ptr& error) {
    if (error) std::rethrow_exception(error);
  };
  FleetSnapshot end;
  asio::co_spawn(loop, last(watch, loop), [&](const std::exception_ptr& error, const FleetSnapshot& snapshot) {
    rethrow(error);
    end = snapshot;
    loop.stop();
  });
  asio::co_spawn(loop, fleet.run(), rethrow);
  asio::co_spawn(loop, report_rates(watch), rethrow);
  loop.run();
  return report_end(watch, end);
}

// A line of JSON for each robot, with its ranges as [first_seq, next_seq).
void write_ledger(const std::string& path, const std::vector<const ReplayedRobot*>& robots) {
  std::ofstream file{path};
  for (const ReplayedRobot* robot : robots) {
    nlohmann::ordered_json line{{"robot_id", robot->config().robot_id},
                                {"boot_id", robot->config().boot_id},
                                {"acknowledged_next_seq", robot->acknowledged_next_seq()},
                                {"overwritten", nlohmann::ordered_json::array()}};
    for (const SampleRange& range : robot->overwritten()) line["overwritten"].push_back({range.first, range.next});
    file << line.dump() << '\n';
  }
  if (!file.flush()) throw std::invalid_argument("--ledger: cannot write " + path);
}

std::string id_of(const FleetOptions& options, int number) { return options.id_prefix + '-' + std::to_string(number); }

}  // namespace

int run_fleet(const FleetOptions& options, const SimulatedRobotConfig& kind, std::ostream& out) {
  allow_sockets(options.robots);
  asio::io_context loop{1};
  Fleet::Members robots;
  for (int i = 0; i < options.robots; ++i) {
    SimulatedRobotConfig config = kind;
    config.robot_id = id_of(options, i + 1);
    config.boot_id = random_boot_id();
    config.world.seed += static_cast<std::uint64_t>(i);
    check(config);
    robots.push_back(std::make_unique<RobotClient>(loop, std::move(config), options.station, LinkLog{},
                                                   options.handshake, options.faults));
  }
  Fleet fleet{loop, std::move(robots), std::chrono::microseconds(SimulatedRobot::kPeriodUs)};
  return run(options, loop, fleet, out);
}

int run_replay(const FleetOptions& options, const std::string& token, const Recording& recording, double rate,
               std::ostream& out) {
  allow_sockets(options.robots);
  asio::io_context loop{1};
  Fleet::Members robots;
  std::vector<const ReplayedRobot*> replayed;
  SimulatedRobotConfig named;  // for the check of id and token
  named.robot_id = id_of(options, options.robots);
  named.token = token;
  check(named);
  ReplayConfig config;
  Lateness acknowledged_after;
  config.token = token;
  config.acknowledged_after = &acknowledged_after;
  config.period_us = replay_period_us(recording, rate);
  for (int i = 0; i < options.robots; ++i) {
    config.robot_id = id_of(options, i + 1);
    config.boot_id = random_boot_id();
    auto robot = std::make_unique<ReplayedRobot>(loop, config, recording, options.station, LinkLog{});
    replayed.push_back(robot.get());
    robots.push_back(std::move(robot));
  }
  Fleet fleet{loop, std::move(robots), ReplayedRobot::turn_period(recording, config.period_us)};
  const int exit_status = run(options, loop, fleet, out, &acknowledged_after);
  if (!options.ledger.empty()) write_ledger(options.ledger, replayed);
  return exit_status;
}

}  // namespace sim_robot
