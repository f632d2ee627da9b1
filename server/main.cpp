// Wires the ground station: what exists, who hears whom, how it stops.
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <csignal>
#include <cstdio>
#include <functional>

#include "server/api/api_server.hpp"
#include "server/cli/command_line.hpp"
#include "server/config.hpp"
#include "server/data_folder.hpp"
#include "server/endpoint.hpp"
#include "server/link/robot_listener.hpp"
#include "server/live/live_feed.hpp"
#include "server/recording/history.hpp"
#include "server/recording/recorder.hpp"
#include "server/recording/runs.hpp"
#include "server/tasks.hpp"
#include "server/worker.hpp"

namespace {

using namespace server;  // NOLINT: this file is the station, seen from outside

ApiOptions api_options(const Config& config, const RestoredState& restored, const RobotListener& robots) {
  ApiOptions options;
  options.endpoint = parse_endpoint(config.http);
  options.or_any_port = config.http_or_any_port;
  options.data_dir = config.data_dir;
  options.hosts = config.http_hosts;
  options.version = RHEONAUT_VERSION;
  options.store_id = restored.store_id;
  options.robots_address = text(robots.endpoint());
  return options;
}

int serve(const Config& config) {
  spdlog::set_default_logger(spdlog::stderr_color_mt("rheonaut"));
  spdlog::set_level(spdlog::level::from_str(config.log_level));
  DataFolder folder{config.data_dir};

  // The ground everything stands on; declared first, destroyed last.
  boost::asio::io_context loop{1};  // all sockets, all live state
  SystemClock clock{loop};
  WorkerThread disk{"disk"}, readers{"readers", 10};  // blocking work
  TaskGroup tasks{loop};

  // Centre: the only owner of live state, and the only door for commands.
  Station station{loop, clock, config.limits, config.link};

  // Out: they hear the station and never call it back; what has become durable comes back through one function.
  Recorder recorder{loop, clock, disk, RecorderOptions{config.database(), config.enrol_on_loopback}};
  Runs runs{clock, recorder};
  History history{config.database(), recorder, readers};
  LiveFeed live{clock};
  station.add_sink(recorder);
  station.add_sink(runs);
  station.add_sink(live);
  recorder.set_on_durable(std::bind_front(&Station::on_durable, &station));
  recorder.set_on_missing(std::bind_front(&Station::request_resend, &station));
  const RestoredState restored = run_first(loop, recorder.open());
  run_first(loop, runs.load());
  station.restore_robots(restored.robots);
  station.restore_pending_stops(restored.pending_stops);

  // In: robots arrive here; each session becomes the station's RobotPort.
  RobotListener robots{loop, clock, tasks, station, recorder, parse_endpoint(config.robots), config.robots_or_any_port};

  // People and scripts.
  ApiServer api{loop, tasks, clock, api_options(config, restored, robots), station, live, runs, history};

  tasks.spawn("recorder", recorder.run());
  tasks.spawn("live feed", live.run());
  tasks.spawn("robots", robots.run());
  tasks.spawn("api", api.run());

  tasks.spawn("signals", tasks.stop_on_signal());
  folder.announce(api.address(), text(robots.endpoint()));
  spdlog::info("ready: robots on {}, page on {}, recording to {}", text(robots.endpoint()), api.address(),
               config.database().string());
  std::printf("Open the cockpit with this one-time link:\n  %s\n", api.login_url().c_str());
  std::fflush(stdout);
  loop.run();        // returns when every task has ended
  recorder.close();  // every sample that was received is on disk
  spdlog::info("stopped");
  return tasks.exit_code();
}

}  // namespace

int main(int argc, char** argv) try {
  std::signal(SIGPIPE, SIG_IGN);
  const cli::Wish wish = cli::parse_command_line(argc, argv);
  if (const auto* answered = std::get_if<cli::Answered>(&wish)) return answered->exit_code;
  if (const auto* check = std::get_if<cli::CheckConfig>(&wish)) return cli::check_config(*check);
  return serve(load_config(std::get<cli::Serve>(wish).flags));
} catch (const std::exception& error) {
  std::fprintf(stderr, "rheonaut: %s\n", error.what());
  return EXIT_FAILURE;
}
