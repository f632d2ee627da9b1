// One client of the proxy and its connection to the target: two sockets with an impaired stream in either direction.
//
// The end of a stream passes through as bytes do, each direction by itself. A reset passes through at once, except
// during a stall.
// Loop thread. Held by a shared pointer: its coroutine holds one, the proxy a weak one.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <memory>
#include <string>

#include "sim_robot/client/robot_client.hpp"
#include "sim_robot/lab/impaired_link.hpp"

namespace sim_robot {

class ProxyConnection : public std::enable_shared_from_this<ProxyConnection> {
 public:
  ProxyConnection(boost::asio::ip::tcp::socket client, StationAddress target, const LinkOptions& options,
                  std::string name, LinkLog log);

  // Dials the target and moves bytes until both directions have ended.
  boost::asio::awaitable<void> run();

  void stall(double for_s);  // nothing arrives on either side; a target not yet dialled is dialled afterwards
  void half_open(Direction direction);
  void resume();
  void impair(const Impairment& up, const Impairment& down);
  void cut(std::size_t after_bytes);  // the end (FIN) to both sides behind this number of bytes
  void reset();                       // RST to both sides
  void close();                       // both sockets, as they are
  bool ended() const { return ended_; }

 private:
  using Clock = std::chrono::steady_clock;

  struct Pipe {
    Pipe(boost::asio::ip::tcp::socket& read_from, boost::asio::ip::tcp::socket& write_to, const Impairment& impairment,
         std::uint64_t seed)
        : from(read_from),
          to(write_to),
          stream(impairment, seed),
          wake(read_from.get_executor()),
          space(read_from.get_executor()) {}

    boost::asio::ip::tcp::socket& from;
    boost::asio::ip::tcp::socket& to;
    ImpairedStream stream;
    boost::asio::steady_timer wake;   // cancelled when `stream` has something else to give
    boost::asio::steady_timer space;  // cancelled when it has room
    bool read_all = false;
  };

  boost::asio::awaitable<void> serve_target();
  boost::asio::awaitable<void> fill(Pipe& pipe);
  boost::asio::awaitable<void> drain(Pipe& pipe);
  void on_end(Pipe& pipe, const boost::system::error_code& error);
  void wake_all();
  std::uint64_t now_us() const;
  Clock::time_point at(std::uint64_t time_us) const { return began_at_ + std::chrono::microseconds(time_us); }

  boost::asio::ip::tcp::socket client_, target_;
  StationAddress address_;
  std::string name_;
  LinkLog log_;
  Clock::time_point began_at_ = Clock::now();
  Pipe up_, down_;
  boost::asio::steady_timer deadline_;  // of a cut: who does not close is closed
  std::uint64_t stalled_until_us_ = 0;
  bool ended_ = false;
};

}  // namespace sim_robot
