// A socket that does not block, and the loop's waits for it.
#include "server/tls/stream_socket.hpp"

#include <array>
#include <boost/asio/as_tuple.hpp>
#include <boost/asio/cancellation_state.hpp>
#include <boost/asio/error.hpp>
#include <boost/asio/this_coro.hpp>
#include <boost/asio/use_awaitable.hpp>

namespace server::tls {
namespace asio = boost::asio;
using asio::ip::tcp;

namespace {

constexpr std::size_t kRecordBytes = 16 * 1024;

}  // namespace

StreamSocket::StreamSocket(tcp::socket socket) : socket_{std::move(socket)}, wire_{socket_.native_handle()} {
  boost::system::error_code ignored;  // a peer that is gone already shows at the first read
  socket_.set_option(tcp::no_delay{true}, ignored);
  socket_.non_blocking(true, ignored);
  const auto remote = socket_.remote_endpoint(ignored);
  peer_ = remote.address().to_string() + ":" + std::to_string(remote.port());
  from_loopback_ = remote.address().is_loopback();
}

StreamSocket::ErrorCode StreamSocket::error_of(const Attempt& attempt) {
  if (attempt.is_end) return asio::error::eof;
  return {attempt.error, boost::system::system_category()};
}

asio::mutable_buffer StreamSocket::scratch() {
  static std::array<std::uint8_t, kRecordBytes> bytes;  // of the loop, which copies into it and seals in one step
  return asio::buffer(bytes);
}

// end() aborts the wait, and then the peer has gone as well: who was made to give way is worked for no further.
asio::awaitable<void> StreamSocket::peer_gone() {
  for (;;) {
    const auto [error] = co_await socket_.async_wait(tcp::socket::wait_read, asio::as_tuple(asio::use_awaitable));
    const auto state = co_await asio::this_coro::cancellation_state;
    if (error && state.cancelled() != asio::cancellation_type::none) throw boost::system::system_error{error};
    if (error) co_return;
    const Attempt ahead = wire_.peek();
    if (ahead.size > 0) co_await socket_.async_wait(tcp::socket::wait_error, asio::use_awaitable);
    if (ahead.size > 0 || ahead.has_ended()) co_return;
  }
}

std::pair<int, base::Wire> StreamSocket::release() && { return {socket_.release(), std::move(wire_)}; }

void StreamSocket::end() {
  boost::system::error_code ignored;
  socket_.shutdown(tcp::socket::shutdown_both, ignored);
  socket_.cancel(ignored);
}

}  // namespace server::tls
