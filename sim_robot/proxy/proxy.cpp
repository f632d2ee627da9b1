// Listens, and passes faults on to the connections.
#include "sim_robot/proxy/proxy.hpp"

#include <algorithm>
#include <boost/asio/as_tuple.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <utility>

#include "base/fields.hpp"
#include "sim_robot/client/listening.hpp"
#include "sim_robot/world/microseconds.hpp"

namespace sim_robot {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;

constexpr std::chrono::milliseconds kPause{50};

std::string text(const tcp::endpoint& endpoint) {
  const std::string address = endpoint.address().to_string();
  return (endpoint.address().is_v6() ? "[" + address + "]" : address) + ":" + std::to_string(endpoint.port());
}

double seconds_until(std::chrono::steady_clock::time_point end) {
  if (end == std::chrono::steady_clock::time_point::max()) return base::kForEver;
  return std::max(0.0, std::chrono::duration<double>(end - std::chrono::steady_clock::now()).count());
}

// Holds the connection for as long as it lasts.
asio::awaitable<void> serve(std::shared_ptr<ProxyConnection> connection) { co_await connection->run(); }

}  // namespace

Proxy::Proxy(asio::io_context& loop, ProxyOptions options, LinkLog log)
    : loop_(loop),
      options_(std::move(options)),
      made_with_{options_.impairment, options_.impairment},
      impairments_(made_with_),
      log_(std::move(log)),
      acceptor_(listen_on(loop, options_.listen)),
      outage_timer_(loop) {
  check(options_.impairment);
  endpoint_ = acceptor_.local_endpoint();
  log_("listening on " + text(endpoint_));
  for (const Outage& outage : options_.outages) plan(outage);
}

void Proxy::plan(const Outage& outage) {
  planned_.push_back(std::make_unique<asio::steady_timer>(loop_, std::chrono::microseconds(microseconds(outage.at_s))));
  planned_.back()->async_wait([this, for_s = outage.for_s](const boost::system::error_code& error) {
    if (!error) this->outage(for_s, false);
  });
}

asio::awaitable<void> Proxy::run() {
  while (acceptor_.is_open()) {
    auto [error, client] = co_await acceptor_.async_accept(asio::as_tuple(asio::use_awaitable));
    if (error == asio::error::operation_aborted) co_return;
    if (error) {  // out of descriptors, or a client that left before it was accepted
      log_("cannot accept: " + error.message());
      asio::steady_timer timer{loop_, kPause};
      co_await timer.async_wait(asio::use_awaitable);
      continue;
    }
    accept(std::move(client));
  }
}

void Proxy::accept(tcp::socket client) {
  boost::system::error_code ignored;
  const std::string name = "connection " + std::to_string(++accepted_);
  log_(name + " from " + text(client.remote_endpoint(ignored)));
  LinkOptions options;
  options.up = impairments_.up;
  options.down = impairments_.down;
  options.seed = options_.seed + accepted_;
  const auto connection = std::make_shared<ProxyConnection>(std::move(client), options_.target, options, name, log_);
  if (outage_ends_ > Clock::now()) connection->stall(seconds_until(outage_ends_));
  connections_.push_back(connection);
  asio::co_spawn(loop_, serve(connection), [log = log_, name](const std::exception_ptr& error) {
    if (error) log(name + " failed");
  });
}

void Proxy::stop() {
  boost::system::error_code ignored;
  acceptor_.close(ignored);
  outage_timer_.cancel();
  planned_.clear();
  for (const auto& connection : open()) connection->close();
}

std::vector<std::shared_ptr<ProxyConnection>> Proxy::open() {
  std::vector<std::shared_ptr<ProxyConnection>> open;
  for (const auto& weak : connections_) {
    auto connection = weak.lock();
    if (connection && !connection->ended()) open.push_back(std::move(connection));
  }
  connections_.assign(open.begin(), open.end());
  return open;
}

std::size_t Proxy::open_connections() { return open().size(); }

void Proxy::cut(std::size_t after_bytes) {
  for (const auto& connection : open()) connection->cut(after_bytes);
}

void Proxy::reset() {
  for (const auto& connection : open()) connection->reset();
}

void Proxy::half_open(Direction direction) {
  for (const auto& connection : open()) connection->half_open(direction);
}

void Proxy::outage(double for_s, bool then_reset) {
  log_("outage of " + std::to_string(for_s) + " s begins");
  const std::uint64_t for_us = microseconds(for_s);
  outage_ends_ = for_us == kNeverUs ? Clock::time_point::max() : Clock::now() + std::chrono::microseconds(for_us);
  for (const auto& connection : open()) connection->stall(for_s);
  outage_timer_.expires_at(outage_ends_);
  outage_timer_.async_wait([this, then_reset](const boost::system::error_code& error) {
    if (error) return;
    log_("outage over");
    if (then_reset) reset();
  });
}

void Proxy::resume() {
  outage_timer_.cancel();
  outage_ends_ = {};
  for (const auto& connection : open()) connection->resume();
}

void Proxy::heal() {
  resume();
  Impairment none;
  none.buffer_bytes = options_.impairment.buffer_bytes;
  impair(none, none);
}

void Proxy::impair(const Impairment& up, const Impairment& down) {
  check(up);
  check(down);
  impairments_ = {up, down};
  for (const auto& connection : open()) connection->impair(up, down);
}

}  // namespace sim_robot
