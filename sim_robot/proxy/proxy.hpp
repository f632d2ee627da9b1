// A TCP proxy that simulates a bad network: it forwards each connection to the target, impaired.
//
// control() changes it while it runs, by a line of one word and its numbers.
//   cut [BYTES] | reset | half-open [up|down|both] | outage SECONDS [reset] | heal
//   delay MS | jitter MS | throttle BYTES_PER_S | loss PROBABILITY | split BYTES
// An outage stalls every connection; new ones are accepted, as a kernel does, and receive nothing. The settings hold
// for bytes from then on. heal ends outage and half-open and resets all settings. Loop thread. Must outlive run(): call
// stop() and let the loop finish before destroying it.
#pragma once

#include <boost/asio/io_context.hpp>
#include <memory>
#include <vector>

#include "sim_robot/proxy/proxy_connection.hpp"

namespace sim_robot {

struct Outage {
  double at_s = 0;  // after the start
  double for_s = 0;
};

struct ProxyOptions {
  boost::asio::ip::tcp::endpoint listen{boost::asio::ip::address_v4::loopback(), 0};
  StationAddress target;
  Impairment impairment;  // of both directions
  std::vector<Outage> outages;
  std::uint64_t seed = 1;
};

class Proxy final : public FaultyLink {
 public:
  // Listens at once; throws boost::system::system_error that names the address.
  Proxy(boost::asio::io_context& loop, ProxyOptions options, LinkLog log);

  boost::asio::awaitable<void> run();  // accepts until stop()
  void stop();                         // closes everything

  // Executes a line; returns what was done, or what is wrong with the line.
  std::string control(const std::string& line);

  void cut(std::size_t after_bytes) override;
  void reset() override;
  void half_open(Direction direction) override;
  void outage(double for_s, bool then_reset) override;
  void resume() override;
  void heal();
  void impair(const Impairment& up, const Impairment& down) override;

  boost::asio::ip::tcp::endpoint endpoint() const { return endpoint_; }
  std::size_t open_connections();
  const LinkImpairments& impairments() const override { return impairments_; }
  const LinkImpairments& made_with() const override { return made_with_; }

 private:
  using Clock = std::chrono::steady_clock;

  void accept(boost::asio::ip::tcp::socket client);
  void plan(const Outage& outage);
  std::vector<std::shared_ptr<ProxyConnection>> open();

  boost::asio::io_context& loop_;
  ProxyOptions options_;
  const LinkImpairments made_with_;
  LinkImpairments impairments_;
  LinkLog log_;
  boost::asio::ip::tcp::acceptor acceptor_;
  boost::asio::ip::tcp::endpoint endpoint_;
  std::vector<std::weak_ptr<ProxyConnection>> connections_;
  std::uint64_t accepted_ = 0;
  Clock::time_point outage_ends_{};
  boost::asio::steady_timer outage_timer_;
  std::vector<std::unique_ptr<boost::asio::steady_timer>> planned_;
};

}  // namespace sim_robot
