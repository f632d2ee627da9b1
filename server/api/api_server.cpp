// Puts the parts of the API together.
#include "server/api/api_server.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdio>
#include <iterator>

#include "base/version.hpp"
#include "server/api/analysis/analysis_routes.hpp"
#include "server/api/experiments/experiment_json.hpp"
#include "server/api/experiments/fit_of_runs.hpp"
#include "server/api/live_socket.hpp"
#include "server/config/endpoint.hpp"
#include "server/storage/recording_parts.hpp"

namespace server::api {
namespace {

std::vector<std::string> host_names(const ApiOptions& options) {
  std::vector<std::string> names = options.hosts;
  if (!options.endpoint.address().is_unspecified()) names.push_back(options.endpoint.address().to_string());
  std::ranges::copy(options.security->names(), std::back_inserter(names));
  return names;
}

StationFacts facts_of(const ApiOptions& options, const net::Listener& listener, const runtime::Clock& clock) {
  return {options.version,        options.store_id,  config::text(listener.endpoint()),
          options.robots_address, clock.steady_us(), options.security};
}

}  // namespace

ApiOptions api_options(const config::Config& config, std::uint64_t store_id, std::string robots_address,
                       net::TransportSecurity& security) {
  ApiOptions options;
  options.endpoint = config::parse_endpoint(config.http);
  options.or_any_port = config.http_or_any_port;
  options.data_dir = config.data_dir;
  options.hosts = config.http_hosts;
  options.version = base::version();
  options.store_id = store_id;
  options.robots_address = std::move(robots_address);
  options.security = &security;
  options.foxglove = config.foxglove;
  return options;
}

ApiServer::ApiServer(boost::asio::io_context& loop, runtime::TaskGroup& tasks, runtime::Clock& clock,
                     const ApiOptions& options, station::Station& station, live::LiveFeed& live,
                     storage::RecordingParts& recording, analysis::AnalysisService& analysis,
                     experiments::Experiments& experiments)
    : tasks_{tasks},
      clock_{clock},
      listener_{loop, clock, options.endpoint, options.or_any_port},
      accounts_{loop, clock, recording.recorder, recording.removal_clock, options.data_dir},
      auth_{loop, clock, accounts_, options.data_dir, options.store_id},
      logins_{clock, accounts_, options.password_cost},
      guard_{auth_, host_names(options), options.security->http().tls != nullptr},
      texts_{loop, station},
      documents_{{analysis, clock, recording.designs, recording.digester, recording.history, recording.metrics,
                  recording.runs}},
      facts_{facts_of(options, listener_, clock)},
      live_{loop, tasks, clock, station, live, texts_, options.version},
      foxglove_clients_{live_, foxglove_feed_, std::to_string(clock.utc_us())},
      tickets_{clock},
      foxglove_{options.foxglove, foxglove_clients_, tickets_, facts_},
      upgrades_{{{"/live", {[this](http::HttpStream stream, http::UpgradeRequest upgrade, identity::Caller caller) {
                    return serve_live(std::move(stream), std::move(upgrade), std::move(caller), live_);
                  }}},
                 {"/foxglove", foxglove_upgrade(foxglove_)}}},
      server_{tasks, clock, listener_, options.security->http(), guard_, router_, upgrades_} {
  if (options.foxglove) station.add_sink(foxglove_feed_);
  live_.keep_experiment = [&experiments](storage::ExperimentId id, const station::Client& client, microseconds age) {
    experiments.keep_alive(id, client, age);
  };
  identity::Rights& rights = accounts_.rights();
  const auto end_moves = [&station](const runtime::EndedRight& right) { station.end_right(right); };
  rights.add({"what robots do", identity::Scope::command, [&station] { return station.acting(); }, end_moves});
  rights.add({"experiments", identity::Scope::command, [&experiments] { return experiments.acting(); }, end_moves});
  rights.add({"jobs", identity::Scope::record, [&jobs = recording.jobs] { return jobs.acting(); },
              [&jobs = recording.jobs](const runtime::EndedRight& right) { jobs.end_right(right); }});
  add_routes(loop, station, live, recording, analysis, experiments);
}

void ApiServer::add_routes(boost::asio::io_context& loop, station::Station& station, live::LiveFeed& live,
                           storage::RecordingParts& recording, analysis::AnalysisService& analysis,
                           experiments::Experiments& experiments) {
  storage::History& history = recording.history;
  add_station_routes(router_, {auth_, clock_, recording.head_watch, recording.recorder, facts_});
  const RecordingRoutes of_recording{clock_, recording, station, *facts_.security, tasks_.exceptions(), lateness_};
  add_recording_routes(router_, of_recording);
  add_health_routes(router_, of_recording);
  add_robot_routes(router_, {loop, history, station, texts_});
  station.set_account_of([this](const std::string& actor) { return accounts_.account_of(actor); });
  add_reservation_routes(router_, {accounts_, clock_, recording.reservations, station});
  add_command_routes(router_, {clock_, history, station});
  add_in_force_routes(router_, {station});
  add_fluid_routes(router_, {clock_, recording.fluid_models, recording.recorder, station});
  add_run_routes(router_, {analysis, recording.digester, recording.finalizer, clock_, recording.disk_watch, live,
                           recording.runs, station});
  add_run_metrics_routes(router_, {documents_});
  add_comparison_routes(router_, {documents_});
  const analysis::ExportParts job_exports{recording.exports, recording.disk_watch, recording.job_files,
                                          recording.export_slots, recording.path()};
  add_job_routes(
      router_,
      {analysis, recording.designs, {documents_, job_exports}, recording.fluid_models, recording.jobs, recording.runs});
  const ExportRoutes exports{tasks_,           recording.exports,         recording.disk_watch, recording.export_slots,
                             recording.path(), recording.exports_folder()};
  add_capsule_routes(router_, {analysis, recording.designs, recording.digester, documents_, exports, recording.runs});
  add_design_routes(router_, {clock_, recording.designs, recording.jobs});
  add_push_routes(router_, {analysis, {clock_, history, station}, recording.designs});
  add_marker_routes(router_, {recording.markers, station});
  add_reference_routes(router_, {analysis, clock_, recording.references});
  add_sample_routes(router_, {history});
  add_overview_routes(router_, {history});
  add_export_routes(router_, exports);
  add_account_routes(router_, {accounts_, auth_, logins_, recording.finalizer, clock_, station, facts_});
  add_experiment_routes(router_, {clock_, experiments, station});
  connect_controllers(experiments, {analysis, recording.designs, station});
  connect_fits(experiments, {clock_, analysis, recording.jobs});
  experiments.set_on_change(
      [&live](const experiments::ExperimentView& view) { live.publish_experiment(summary_json(view)); });
  recording.runs.set_on_change([&live](const storage::Run& run) { live.publish_run(api::to_json(run)); });
  add_foxglove_routes(router_, foxglove_);
  add_audit_routes(router_, {clock_, history, recording.recorder});
}

boost::asio::awaitable<void> ApiServer::run() {
  tasks_.spawn("accounts", accounts_.run());
  tasks_.spawn("rights", accounts_.watch_rights());
  tasks_.spawn("lateness", lateness_.run(clock_));
  co_await server_.run();
}

std::string ApiServer::address() const { return config::text(listener_.endpoint()); }

void ApiServer::say_ready(const std::string& robots_address, const std::filesystem::path& data_dir) {
  spdlog::info("ready: page {}, robots {}, data {}", url(), robots_address, data_dir.string());
  fmt::print("Open the cockpit with this one-time link:\n  {}\n", login_url());
  std::fflush(stdout);
}

std::string ApiServer::url() const {
  auto endpoint = listener_.endpoint();
  if (endpoint.address().is_unspecified()) endpoint.address(boost::asio::ip::address_v4::loopback());
  return base_url(facts_, config::text(endpoint));
}

config::Announcement ApiServer::announcement() const {
  const net::TransportSecurity& security = *facts_.security;
  return {address(), facts_.robots_address, security.to_trust(security.http()), security.to_trust(security.robots())};
}

std::string ApiServer::login_url() { return api::login_url(url(), auth_.new_login_code()); }

}  // namespace server::api
