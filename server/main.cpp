// Wires the ground station: what exists, what reports to what, how it stops.
#include <spdlog/spdlog.h>

#include "base/resource_signals.hpp"
#include "server/analysis/analysis_service.hpp"
#include "server/api/api_server.hpp"
#include "server/cli/command_line.hpp"
#include "server/config/endpoint.hpp"
#include "server/config/station_document.hpp"
#include "server/config/station_folder.hpp"
#include "server/config/supervision.hpp"
#include "server/experiments/runner/experiments.hpp"
#include "server/link/robot_listener.hpp"
#include "server/live/live_feed.hpp"
#include "server/net/transport_security.hpp"
#include "server/runtime/exceptions.hpp"
#include "server/runtime/log.hpp"
#include "server/runtime/real_time.hpp"
#include "server/station/models/model_sender.hpp"
#include "server/storage/recording_parts.hpp"

using namespace server;  // NOLINT: this file is the station, seen from outside
static int serve(const config::Config& config) {
  runtime::start_log(config.log_level, config.log_format);
  config::DataFolder folder = config::station_folder(config);
  boost::asio::io_context loop{1};  // all sockets, all live state; everything stands on it: it is destroyed last
  runtime::SystemClock clock{loop};
  runtime::WorkerThread disk{"disk"}, checkpoints{"checkpoints"};
  runtime::WorkerThread readers{"readers", 10}, exports{"exports", 10}, maths{"maths", 10};
  runtime::TaskGroup tasks{loop};
  net::TransportSecurity security{clock, config};  // of both ports
  // Centre: the only owner of live state, and the only way in for commands.
  station::Station station{loop, clock, config.envelope, config.link};
  // Out: they get the station's reports and never call it back; only what is durable comes back, through one function.
  const storage::RecorderOptions recorder{config.database(), config.enrolment};
  storage::RecordingParts recording{loop, clock, disk, readers, exports, checkpoints, recorder, config.recording};
  live::LiveFeed live{clock};
  recording.connect(station);
  recording.runs.set_station_document(station_document(config));
  station.add_sink(live);
  const storage::RestoredState restored = runtime::run_first(loop, recording.open());
  station.restore(restored.robots, restored.pending_stops, restored.reservations);
  // In: robots arrive here; each session becomes the station's RobotLink. Robots are sent the model of their fluid.
  const auto at = config::parse_endpoint(config.robots);
  link::RobotListener robots{
      loop, clock, tasks, station, recording.recorder, at, config.robots_or_any_port, security.robots()};
  station::ModelSender models{loop, tasks, clock, station, recording.fluid_models.in_force()};
  // People and scripts, and the experiments that act in their name.
  experiments::Experiments experiments{{loop, clock, tasks, station}, recording, maths, config.experiments};
  analysis::AnalysisService analysis{recording.history, maths};
  const auto options = api::api_options(config, restored.store_id, config::text(robots.endpoint()), security);
  api::ApiServer api{loop, tasks, clock, options, station, live, recording, analysis, experiments};
  if (config.real_time) tasks.spawn("priorities", keep_priorities(disk, clock));
  recording.spawn(tasks);
  tasks.spawn("control", station.watch_control());
  tasks.spawn("live feed", live.run());
  tasks.spawn("robots", robots.run());
  tasks.spawn("api", api.run());
  tasks.spawn("experiments", experiments.run());
  tasks.spawn("signals", tasks.stop_on_signal());
  tasks.spawn("security", security.run());
  tasks.spawn("announcement", folder.announce(clock, api.announcement()));
  tasks.spawn("supervision", config::tell_supervisor(clock, "page " + api.url()));
  api.say_ready(options.robots_address, config.data_dir);
  tasks.run(clock);   // returns when every task has ended
  recording.close();  // every sample that was received is on disk
  spdlog::info("stopped");
  return tasks.exit_code();
}

int main(int argc, char** argv) try {
  base::ignore_resource_signals();
  const cli::CommandLine line = cli::parse_command_line(argc, argv);
  if (const auto exit_code = cli::answer(line)) return *exit_code;
  return serve(load_config(std::get<cli::Serve>(line).flags));
} catch (const std::exception& error) {
  fmt::print(stderr, "rheonaut: {}\n", cli::one_line(runtime::text_of(error)));
  return EXIT_FAILURE;
}
