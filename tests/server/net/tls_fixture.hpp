// A port with TLS on the loop of a test, and another program's end.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <openssl/err.h>
#include <poll.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>

#include <boost/asio/as_tuple.hpp>
#include <csignal>
#include <fstream>
#include <sstream>

#include "server/cli/data/certificate.hpp"
#include "server/net/byte_stream.hpp"
#include "server/net/listener.hpp"
#include "server/net/poll_set.hpp"
#include "server/net/transport_security.hpp"
#include "server/runtime/tasks.hpp"
#include "tests/server/virtual_clock.hpp"

namespace server {

namespace asio = boost::asio;
namespace fs = std::filesystem;
using asio::ip::tcp;
using namespace std::chrono_literals;

inline constexpr int kPatience = 5000;  // times 1 ms of real time

class TlsTest : public ::testing::Test {
 protected:
  TlsTest() {
    std::signal(SIGPIPE, SIG_IGN);
    std::string name = (fs::temp_directory_path() / "rheonaut-tls-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error{"cannot make " + name};
    config.data_dir = name;
    config.tls.mode = config::TlsMode::on;
    spdlog::set_default_logger(
        std::make_shared<spdlog::logger>("test", std::make_shared<spdlog::sinks::ostream_sink_mt>(log)));
    make_certificate({});
  }
  ~TlsTest() override {
    tasks.stop();
    clock.settle();
    spdlog::set_default_logger(before);
    fs::remove_all(config.data_dir);
  }

  void make_certificate(cli::Certificate options) {
    options.data_dir = config.data_dir;
    std::ostringstream ignored;
    cli::run(options, ignored);
  }
  void renew(bool new_key = false, int days = 825) {
    cli::Certificate options;
    options.renew = true;
    options.new_key = new_key;
    options.days = days;
    make_certificate(options);
  }

  net::TransportSecurity& start() {
    security = std::make_unique<net::TransportSecurity>(clock, config);
    clock.add_worker(security->worker());
    tasks.spawn("security", security->run());
    auto on_connection = [this](tcp::socket socket) {
      served = std::make_unique<tls::StreamSocket>(std::move(socket));
      outcome.reset();
      tasks.spawn("handshake", shake_hands());
    };
    tasks.spawn("listener", listener.run(on_connection));
    tasks.spawn("sockets", sockets.run());
    tasks.spawn("sockets to write to", sockets.run_awaited());
    clock.settle();
    return *security;
  }

  // How often the log has it.
  int said(const std::string& what) const {
    const std::string text = log.str();
    int count = 0;
    for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++count;
    return count;
  }

  asio::awaitable<void> shake_hands() { outcome = co_await security->http().tls->secure(*served, "test port"); }

  config::Config config;
  asio::io_context loop{1};
  VirtualClock clock{loop};
  runtime::TaskGroup tasks{loop};
  net::Listener listener{loop, clock, {asio::ip::address_v4::loopback(), 0}};
  std::unique_ptr<net::TransportSecurity> security;
  std::unique_ptr<tls::StreamSocket> served;  // the last connection
  net::PollSet sockets{loop, clock};
  std::optional<tls::TlsHandshakes::Outcome> outcome;
  std::ostringstream log;
  std::shared_ptr<spdlog::logger> before = spdlog::default_logger();
};

// Another program's end, which lets the station run while it waits.
class Client {
 public:
  Client(VirtualClock& clock, const tcp::endpoint& endpoint, int receive_bytes = 0) : clock_{clock} {
    socket_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (receive_bytes > 0) ::setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &receive_bytes, sizeof receive_bytes);
    if (::connect(socket_, endpoint.data(), static_cast<socklen_t>(endpoint.size())) != 0) {
      throw std::runtime_error{"cannot connect"};
    }
    ::fcntl(socket_, F_SETFL, O_NONBLOCK);
    clock_.settle();
  }
  ~Client() { hang_up(); }
  void hang_up() {
    if (socket_ >= 0) ::close(socket_);
    socket_ = -1;
  }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  // One attempt of `step` after another, until it gives 1 or fails for good.
  template <class Step>
  bool until_done(Step step) {
    for (int i = 0; i < kPatience; ++i) {
      ERR_clear_error();
      const int result = step();
      if (result == 1) return true;
      const int why = SSL_get_error(ssl_.get(), result);
      if (why != SSL_ERROR_WANT_READ && why != SSL_ERROR_WANT_WRITE) return false;
      clock_.settle();
      pollfd ready{socket_, POLLIN, 0};
      ::poll(&ready, 1, 1);
    }
    return false;
  }

  // `then`: leaves together with the end of the handshake.
  bool shake_hands(std::string_view then = "") {
    ssl_.reset(SSL_new(context_.get()));
    SSL_set_fd(ssl_.get(), socket_);
    SSL_set_connect_state(ssl_.get());
    const bool done = until_done([this] { return SSL_do_handshake(ssl_.get()); });
    if (done) send(then);
    clock_.settle();
    return done;
  }
  // In records of its own; the station does not run meanwhile.
  void send(std::string_view bytes) {
    std::size_t size = 0;
    if (!bytes.empty()) ASSERT_EQ(SSL_write_ex(ssl_.get(), bytes.data(), bytes.size(), &size), 1);
  }
  std::string read(std::size_t count) {
    std::string all;
    while (all.size() < count) {
      std::string piece(count - all.size(), '\0');
      std::size_t size = 0;
      if (!until_done([&] { return SSL_read_ex(ssl_.get(), piece.data(), piece.size(), &size); })) break;
      all.append(piece, 0, size);
    }
    return all;
  }
  void cork(int corked) const { ::setsockopt(socket_, IPPROTO_TCP, TCP_CORK, &corked, sizeof corked); }  // one segment
  void send_plain(std::string_view bytes) {
    ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    clock_.settle();
  }
  std::string pin() const { return tls::describe(*SSL_get0_peer_certificate(ssl_.get())).pin; }

 private:
  VirtualClock& clock_;
  int socket_ = -1;
  base::Openssl<SSL_CTX> context_{SSL_CTX_new(TLS_client_method())};
  base::Openssl<SSL> ssl_;
};

}  // namespace server
