// Everything that people and scripts reach by HTTP: the port, the credentials, the routes, /live and the cockpit.
//
// Loop thread. What it is given outlives it; it outlives its connections, which are tasks of the group.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "server/analysis/documents/run_documents.hpp"
#include "server/api/experiments/experiment_routes.hpp"
#include "server/api/foxglove_routes.hpp"
#include "server/api/live_messages.hpp"
#include "server/api/routes/routes.hpp"
#include "server/config/config.hpp"
#include "server/config/data_folder.hpp"
#include "server/http/http_server.hpp"
#include "server/identity/auth.hpp"
#include "server/identity/logins.hpp"
#include "server/live/robot_texts.hpp"
#include "server/net/transport_security.hpp"
#include "server/runtime/loop_lateness.hpp"

namespace server::api {

struct ApiOptions {
  boost::asio::ip::tcp::endpoint endpoint;  // port 0: any free one
  bool or_any_port = false;                 // a taken port is replaced by a free one
  std::filesystem::path data_dir;           // rheonaut.token lives here; must exist
  std::vector<std::string> hosts;           // further names for the Host header
  std::string version;
  std::uint64_t store_id = 0;
  std::string robots_address;                  // "127.0.0.1:7070", for people
  net::TransportSecurity* security = nullptr;  // must be given
  runtime::PasswordCost password_cost;
  bool foxglove = false;  // /foxglove is served
};

ApiOptions api_options(const config::Config& config, std::uint64_t store_id, std::string robots_address,
                       net::TransportSecurity& security);

class ApiServer {
 public:
  // Opens the port and makes the token. Throws when either is not possible.
  ApiServer(boost::asio::io_context& loop, runtime::TaskGroup& tasks, runtime::Clock& clock, const ApiOptions& options,
            station::Station& station, live::LiveFeed& live, storage::RecordingParts& recording,
            analysis::AnalysisService& analysis, experiments::Experiments& experiments);

  boost::asio::awaitable<void> run();

  std::uint16_t port() const { return listener_.endpoint().port(); }
  std::string address() const;  // "127.0.0.1:8080"
  std::string url() const;      // "https://127.0.0.1:8080", for a browser on this machine
  config::Announcement announcement() const;
  const http::Router& router() const { return router_; }
  std::string login_url();  // a link that lets one page in, for 10 minutes
  // In the log, and with a link on standard output for the person at the console.
  void say_ready(const std::string& robots_address, const std::filesystem::path& data_dir);

  identity::Accounts& accounts() { return accounts_; }
  const identity::Logins& logins() const { return logins_; }

 private:
  void add_routes(boost::asio::io_context& loop, station::Station& station, live::LiveFeed& live,
                  storage::RecordingParts& recording, analysis::AnalysisService& analysis,
                  experiments::Experiments& experiments);

  runtime::TaskGroup& tasks_;
  runtime::Clock& clock_;
  net::Listener listener_;
  identity::Accounts accounts_;
  identity::Auth auth_;
  identity::Logins logins_;
  http::RequestGuard guard_;
  live::RobotTexts texts_;
  runtime::LoopLateness lateness_;
  analysis::RunDocuments documents_;
  StationFacts facts_;
  LiveParts live_;
  live::foxglove::Feed foxglove_feed_;
  FoxgloveClients foxglove_clients_;
  identity::Tickets tickets_;
  FoxgloveRoutes foxglove_;
  http::Upgrades upgrades_;
  http::Router router_;
  http::HttpServer server_;
};

}  // namespace server::api
