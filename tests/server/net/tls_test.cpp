// TLS of a port: handshakes with a time limit, writes that do not wait, certificates that come into force.
#include <fcntl.h>
#include <netinet/in.h>
#include <openssl/err.h>
#include <poll.h>
#include <spdlog/sinks/ostream_sink.h>
#include <sys/socket.h>

#include <boost/asio/as_tuple.hpp>
#include <csignal>
#include <fstream>
#include <sstream>

#include "server/cli/certificate.hpp"
#include "server/net/byte_stream.hpp"
#include "server/net/listener.hpp"
#include "server/net/transport_security.hpp"
#include "server/tasks.hpp"
#include "tests/server/virtual_clock.hpp"

namespace server {
namespace {

namespace asio = boost::asio;
namespace fs = std::filesystem;
using asio::ip::tcp;
using namespace std::chrono_literals;
using ::testing::HasSubstr;

constexpr int kPatience = 5000;  // times 1 ms of real time

class TlsTest : public ::testing::Test {
 protected:
  TlsTest() {
    std::signal(SIGPIPE, SIG_IGN);
    std::string name = (fs::temp_directory_path() / "rheonaut-tls-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error{"cannot make " + name};
    config.data_dir = name;
    config.tls.mode = TlsMode::on;
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

  void make_certificate(cli::Certificate wish) {
    wish.data_dir = config.data_dir;
    std::ostringstream ignored;
    cli::run(wish, ignored);
  }
  void renew(bool new_key = false, int days = 825) {
    cli::Certificate wish;
    wish.renew = true;
    wish.new_key = new_key;
    wish.days = days;
    make_certificate(wish);
  }

  TransportSecurity& start() {
    security = std::make_unique<TransportSecurity>(clock, config);
    clock.add_worker(security->worker());
    tasks.spawn("security", security->run());
    auto on_connection = [this](tcp::socket socket) {
      served = std::make_unique<StreamSocket>(std::move(socket));
      outcome.reset();
      tasks.spawn("handshake", shake_hands());
    };
    tasks.spawn("listener", listener.run(on_connection));
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

  Config config;
  asio::io_context loop{1};
  VirtualClock clock{loop};
  TaskGroup tasks{loop};
  Listener listener{loop, clock, {asio::ip::address_v4::loopback(), 0}};
  std::unique_ptr<TransportSecurity> security;
  std::unique_ptr<StreamSocket> served;  // the last connection
  std::optional<TlsGate::Outcome> outcome;
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
  ~Client() { ::close(socket_); }
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

  bool shake_hands() {
    ssl_.reset(SSL_new(context_.get()));
    SSL_set_fd(ssl_.get(), socket_);
    SSL_set_connect_state(ssl_.get());
    const bool done = until_done([this] { return SSL_do_handshake(ssl_.get()); });
    clock_.settle();
    return done;
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
  void send_plain(std::string_view bytes) {
    ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    clock_.settle();
  }
  std::string pin() const { return describe(*SSL_get0_peer_certificate(ssl_.get())).pin; }

 private:
  VirtualClock& clock_;
  int socket_ = -1;
  Openssl<SSL_CTX> context_{SSL_CTX_new(TLS_client_method())};
  Openssl<SSL> ssl_;
};

TEST_F(TlsTest, AClientThatSaysNothingIsLetGoAfterTenSecondsAndHoldsNobodyUp) {
  start();
  Client silent{clock, listener.endpoint()};
  EXPECT_FALSE(outcome);
  const std::int64_t begun_us = clock.steady_us();
  ASSERT_TRUE(clock.run_until([&] { return outcome.has_value(); }, 20s));
  EXPECT_EQ(*outcome, TlsGate::Outcome::failed);
  EXPECT_EQ(clock.steady_us() - begun_us, kHandshakeTime.count());
  EXPECT_EQ(security->gate()->counters().failed, 1U);
  EXPECT_THAT(log.str(), HasSubstr("test port: no TLS with 127.0.0.1:"));
  EXPECT_THAT(log.str(), HasSubstr("not done within 10 s"));
}

TEST_F(TlsTest, WhoDoesNotSpeakTlsIsToldApartAndWhatItSentCanStillBeRead) {
  start();
  Client client{clock, listener.endpoint()};
  client.send_plain("GET / HTTP/1.1\r\n");
  ASSERT_TRUE(clock.run_until([&] { return outcome.has_value(); }, 1s));
  EXPECT_EQ(*outcome, TlsGate::Outcome::not_tls);
  char bytes[64];
  EXPECT_EQ(::recv(served->tcp().native_handle(), bytes, sizeof bytes, MSG_DONTWAIT), 16);
  Client garbage{clock, listener.endpoint()};
  garbage.send_plain(std::string(1, '\x16') + std::string(200, 'x'));
  ASSERT_TRUE(clock.run_until([&] { return outcome.has_value(); }, 1s));
  EXPECT_EQ(*outcome, TlsGate::Outcome::failed);
}

TEST_F(TlsTest, AtMostOneFailureASecondIsLogged) {
  start();
  for (int i = 0; i < 20; ++i) {
    Client client{clock, listener.endpoint()};
    client.send_plain("x");
    ASSERT_TRUE(clock.run_until([&] { return outcome.has_value(); }, 1s));
  }
  EXPECT_EQ(said("no TLS"), 1);
  clock.run_for(1s);
  Client client{clock, listener.endpoint()};
  client.send_plain("x");
  ASSERT_TRUE(clock.run_until([&] { return outcome.has_value(); }, 1s));
  EXPECT_EQ(said("no TLS"), 2);
  EXPECT_THAT(log.str(), HasSubstr("(and 19 before)"));
  EXPECT_EQ(security->gate()->counters().failed, 21U);
}

// What an emergency stop rests on: the frame is on its way when write_now() returns, without a turn of the loop.
TEST_F(TlsTest, BytesLeaveAtOnce) {
  start();
  Client client{clock, listener.endpoint()};
  ASSERT_TRUE(client.shake_hands());
  ASSERT_EQ(outcome, TlsGate::Outcome::secure);
  const auto stream = make_stream(std::move(*served));
  EXPECT_EQ(stream->write_now(asio::buffer("stop", 4)), 4U);
  EXPECT_EQ(client.read(4), "stop");
}

// A peer that does not read: what does not fit waits, and nothing is lost, doubled or out of order.
TEST_F(TlsTest, WhatASocketDoesNotTakeIsWhatTheNextWriteBeginsWith) {
  start();
  Client client{clock, listener.endpoint(), 4096};
  ASSERT_TRUE(client.shake_hands());
  const auto stream = make_stream(std::move(*served));
  std::string sent;
  std::string rest;
  for (int frame = 0; rest.empty() && frame < 100'000; ++frame) {
    const std::string bytes = std::to_string(frame) + std::string(900, static_cast<char>('a' + frame % 26));
    const std::size_t taken = stream->write_now(asio::buffer(bytes));
    sent += bytes;
    rest = bytes.substr(taken);
  }
  ASSERT_FALSE(rest.empty()) << "the socket never filled";
  std::optional<bool> written;
  const auto write = [](ByteStream& to, std::string bytes, std::optional<bool>& done) -> asio::awaitable<void> {
    done = co_await to.write(asio::buffer(bytes));
  };
  tasks.spawn("write", write(*stream, rest, written));
  clock.settle();
  EXPECT_FALSE(written) << "it waits for room";
  EXPECT_EQ(client.read(sent.size()), sent);
  clock.settle();
  EXPECT_EQ(written, true);
  EXPECT_EQ(stream->write_now(asio::buffer("stop", 4)), 4U);
  EXPECT_EQ(client.read(4), "stop");
}

TEST_F(TlsTest, ANewCertificateIsInForceForNewConnectionsWithinTwoLooks) {
  start();
  const std::string first = security->gate()->context().certificate.pin;
  Client old_client{clock, listener.endpoint()};
  ASSERT_TRUE(old_client.shake_hands());
  EXPECT_EQ(old_client.pin(), first);
  auto stream = make_stream(std::move(*served));

  renew(true);
  clock.run_for(2 * kCertificateLook + 1ms);
  const std::string second = security->gate()->context().certificate.pin;
  EXPECT_NE(second, first);
  Client new_client{clock, listener.endpoint()};
  ASSERT_TRUE(new_client.shake_hands());
  EXPECT_EQ(new_client.pin(), second);
  stream->write_now(asio::buffer("still", 5));
  EXPECT_EQ(old_client.read(5), "still") << "connections keep what they have";
}

TEST_F(TlsTest, ABrokenNewFileIsSaidOnceAndTheOldOneStaysInForce) {
  start();
  const std::string first = security->gate()->context().certificate.pin;
  std::ofstream{config.tls_certificate()} << "nonsense";
  clock.run_for(60s);
  EXPECT_EQ(security->gate()->context().certificate.pin, first);
  EXPECT_THAT(log.str(), HasSubstr("holds no certificate in PEM"));
  EXPECT_EQ(said("the one before stays in force"), 1);
  Client client{clock, listener.endpoint()};
  EXPECT_TRUE(client.shake_hands());
  fs::remove(config.tls_key());
  clock.run_for(60s);
  EXPECT_EQ(said("the one before stays in force"), 2) << "a file that goes missing is said, too";
  EXPECT_EQ(security->gate()->context().certificate.pin, first);
}

TEST_F(TlsTest, AnExpiryIsWarnedOfThirtyDaysBeforeAndOnceADay) {
  start();
  EXPECT_FALSE(security->state()["certificate"]["expires_soon"].get<bool>());
  const std::int64_t not_after_us = security->gate()->context().certificate.not_after_us;
  clock.step_utc(microseconds{not_after_us - clock.utc_us()} - 29h * 24);
  clock.skip(24h);
  clock.run_for(3s);
  EXPECT_TRUE(security->state()["certificate"]["expires_soon"].get<bool>());
  EXPECT_EQ(said("expires in 2"), 1);
  clock.run_for(1min);
  EXPECT_EQ(said("expires in 2"), 1);
  clock.skip(24h);
  clock.run_for(3s);
  EXPECT_EQ(said("expires in 2"), 2);
  clock.step_utc(30h * 24);
  clock.skip(24h);
  clock.run_for(3s);
  EXPECT_EQ(said("has expired"), 1);
}

TEST_F(TlsTest, AKeyThatIsNotTheCertificatesIsRefusedByName) {
  const fs::path kept = config.data_dir / "other.key";
  fs::copy_file(config.tls_key(), kept);
  renew(true);
  config.tls.key = kept;
  config.tls.certificate = config.data_dir / "tls" / "station.crt";
  try {
    TransportSecurity broken{clock, config};
    FAIL() << "was accepted";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("other.key"));
    EXPECT_THAT(error.what(), HasSubstr("is not that of the certificate"));
  }
}

TEST_F(TlsTest, PlainTcpBeyondThisMachineIsShoutedAtOnceAndEachHour) {
  config.tls.mode = TlsMode::automatic;
  config.tls.insecure = true;
  config.robots = "192.0.2.1:7070";
  TransportSecurity exposed{clock, config};
  EXPECT_EQ(exposed.robots().tls, nullptr);
  EXPECT_TRUE(exposed.state()["exposed"].get<bool>());
  const std::string shout = "INSECURE: robots.listen = 192.0.2.1:7070";
  EXPECT_EQ(said(shout), 1);
  tasks.spawn("security", exposed.run());
  clock.run_for(59min);
  EXPECT_EQ(said(shout), 1);
  clock.run_for(2min);
  EXPECT_EQ(said(shout), 2);
  tasks.stop();
  clock.settle();
}

TEST_F(TlsTest, WithoutACertificateTheSentenceSaysHowToMakeOne) {
  fs::remove_all(config.data_dir / "tls");
  try {
    TransportSecurity none{clock, config};
    FAIL() << "was accepted";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("rheonaut certificate --data " + config.data_dir.string()));
  }
}

}  // namespace
}  // namespace server
