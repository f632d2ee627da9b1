// The stream over a socket.
#include "server/net/byte_stream.hpp"

#include <netinet/in.h>
#include <netinet/tcp.h>

#include <boost/asio/as_tuple.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/asio/write.hpp>

#include "server/net/stream_socket.hpp"

namespace server {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;

constexpr int kMaxUnsentBytes = 4096;

class SocketStream final : public ByteStream {
 public:
  explicit SocketStream(StreamSocket socket) : socket_{std::move(socket)} {
    boost::system::error_code ignored;  // a peer that is gone already shows at the first read
    using NotSentLowat = asio::detail::socket_option::integer<IPPROTO_TCP, TCP_NOTSENT_LOWAT>;
    socket_.tcp().set_option(NotSentLowat{kMaxUnsentBytes}, ignored);
  }

  asio::awaitable<std::size_t> read_some(asio::mutable_buffer into) override {
    const auto [error, size] = co_await socket_.async_read_some(into, asio::as_tuple(asio::use_awaitable));
    co_return error ? 0 : size;
  }

  std::size_t write_now(asio::const_buffer bytes) override { return socket_.write_now(bytes); }

  asio::awaitable<bool> write(asio::const_buffer bytes) override {
    const auto [error, size] = co_await asio::async_write(socket_, bytes, asio::as_tuple(asio::use_awaitable));
    co_return !error;
  }

  void close() override { socket_.end(); }

  std::string peer() const override { return socket_.peer(); }
  bool from_loopback() const override { return socket_.from_loopback(); }

 private:
  StreamSocket socket_;
};

}  // namespace

std::unique_ptr<ByteStream> make_stream(StreamSocket socket) {
  return std::make_unique<SocketStream>(std::move(socket));
}

std::unique_ptr<ByteStream> make_tcp_stream(tcp::socket socket) { return make_stream(StreamSocket{std::move(socket)}); }

}  // namespace server
