// Everything that people and scripts reach by HTTP: the port, the credentials, the routes, /live and the cockpit.
//
// Loop thread. What it is given outlives it; it outlives its connections, which are tasks of the group.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "server/api/live_messages.hpp"
#include "server/api/routes/routes.hpp"
#include "server/config/config.hpp"
#include "server/http/http_server.hpp"
#include "server/identity/auth.hpp"
#include "server/identity/logins.hpp"
#include "server/live/robot_texts.hpp"
#include "server/net/transport_security.hpp"

namespace server {

struct ApiOptions {
  boost::asio::ip::tcp::endpoint endpoint;  // port 0: any free one
  bool or_any_port = false;                 // a taken port is replaced by a free one
  std::filesystem::path data_dir;           // rheonaut.token lives here; must exist
  std::vector<std::string> hosts;           // further names for the Host header
  std::string version;
  std::uint64_t store_id = 0;
  std::string robots_address;             // "127.0.0.1:7070", for people
  TransportSecurity* security = nullptr;  // must be given
  PasswordCost password_cost;
};

ApiOptions api_options(const Config& config, std::uint64_t store_id, std::string robots_address,
                       TransportSecurity& security);

class ApiServer {
 public:
  // Opens the port and makes the token. Throws when either is not possible.
  ApiServer(boost::asio::io_context& loop, TaskGroup& tasks, Clock& clock, const ApiOptions& options, Station& station,
            LiveFeed& live, RecordingParts& recording, AnalysisService& analysis);

  boost::asio::awaitable<void> run();

  std::uint16_t port() const { return listener_.endpoint().port(); }
  std::string address() const;  // "127.0.0.1:8080"
  std::string url() const;      // "https://127.0.0.1:8080", for a browser on this machine
  const Router& router() const { return router_; }
  std::string login_url();  // a link that lets one page in, for 10 minutes
  void print_login_url();   // on standard output, for the person at the console

  Accounts& accounts() { return accounts_; }
  const Logins& logins() const { return logins_; }

 private:
  void add_routes(boost::asio::io_context& loop, Station& station, LiveFeed& live, RecordingParts& recording,
                  AnalysisService& analysis);

  TaskGroup& tasks_;
  Clock& clock_;
  Listener listener_;
  Accounts accounts_;
  Auth auth_;
  Logins logins_;
  RequestGuard guard_;
  RobotTexts texts_;
  StationFacts facts_;
  LiveParts live_;
  Upgrades upgrades_;
  Router router_;
  HttpServer server_;
};

}  // namespace server
