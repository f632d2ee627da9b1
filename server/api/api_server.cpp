// Puts the parts of the API together.
#include "server/api/api_server.hpp"

#include <fmt/format.h>

#include "server/endpoint.hpp"

namespace server {
namespace {

std::vector<std::string> host_names(const ApiOptions& options) {
  std::vector<std::string> names = options.hosts;
  if (!options.endpoint.address().is_unspecified()) names.push_back(options.endpoint.address().to_string());
  return names;
}

StationFacts facts_of(const ApiOptions& options, const Listener& listener, const Clock& clock) {
  return {options.version, options.store_id, text(listener.endpoint()), options.robots_address, clock.steady_us()};
}

}  // namespace

ApiServer::ApiServer(boost::asio::io_context& loop, TaskGroup& tasks, Clock& clock, const ApiOptions& options,
                     Station& station, LiveFeed& live, Runs& runs, History& history)
    : listener_{loop, clock, options.endpoint, options.or_any_port},
      auth_{clock, options.data_dir},
      guard_{auth_, host_names(options)},
      parts_{loop, tasks, clock, station, live, runs, history, auth_, facts_of(options, listener_, clock)},
      live_{loop, tasks, clock, station, live, options.version},
      server_{tasks, clock, listener_, guard_, router_, live_} {
  add_routes(router_, parts_);
}

std::string ApiServer::address() const { return text(listener_.endpoint()); }

std::string ApiServer::login_url() {
  auto endpoint = listener_.endpoint();
  if (endpoint.address().is_unspecified()) endpoint.address(boost::asio::ip::address_v4::loopback());
  return fmt::format("http://{}/login?code={}", text(endpoint), auth_.new_login_code());
}

}  // namespace server
