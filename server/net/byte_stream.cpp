// The TCP stream.
#include "server/net/byte_stream.hpp"

#include <netinet/in.h>
#include <netinet/tcp.h>

#include <boost/asio/as_tuple.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/asio/write.hpp>

namespace server {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;

constexpr int kMaxUnsentBytes = 4096;

class TcpStream final : public ByteStream {
 public:
  explicit TcpStream(tcp::socket socket) : socket_{std::move(socket)} {
    boost::system::error_code ignored;  // a peer that is gone already shows at the first read
    socket_.set_option(tcp::no_delay{true}, ignored);
    socket_.non_blocking(true, ignored);
    using NotSentLowat = asio::detail::socket_option::integer<IPPROTO_TCP, TCP_NOTSENT_LOWAT>;
    socket_.set_option(NotSentLowat{kMaxUnsentBytes}, ignored);
    const auto remote = socket_.remote_endpoint(ignored);
    peer_ = remote.address().to_string() + ":" + std::to_string(remote.port());
    from_loopback_ = remote.address().is_loopback();
  }

  asio::awaitable<std::size_t> read_some(asio::mutable_buffer into) override {
    const auto [error, size] = co_await socket_.async_read_some(into, asio::as_tuple(asio::use_awaitable));
    co_return error ? 0 : size;
  }

  std::size_t write_now(asio::const_buffer bytes) override {
    boost::system::error_code ignored;  // would block, or the stream has ended: write() tells which
    return socket_.non_blocking() ? socket_.write_some(bytes, ignored) : 0;
  }

  asio::awaitable<bool> write(asio::const_buffer bytes) override {
    const auto [error, size] = co_await asio::async_write(socket_, bytes, asio::as_tuple(asio::use_awaitable));
    co_return !error;
  }

  void close() override {
    boost::system::error_code ignored;
    socket_.shutdown(tcp::socket::shutdown_both, ignored);
    socket_.close(ignored);
  }

  std::string peer() const override { return peer_; }
  bool from_loopback() const override { return from_loopback_; }

 private:
  tcp::socket socket_;
  std::string peer_;
  bool from_loopback_ = false;
};

}  // namespace

std::unique_ptr<ByteStream> make_tcp_stream(tcp::socket socket) {
  return std::make_unique<TcpStream>(std::move(socket));
}

}  // namespace server
