// A connected TCP socket, plain or with TLS over it: the one type that both ports read and write, and that HTTP and
// WebSocket are compiled for (Beast's AsyncStream).
//
// One reader and one writer at a time; what a write did not take must be what the next one begins with. Loop thread,
// but for the wire's handshake. It is moved only while nothing is under way.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/asio/compose.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/beast/websocket/teardown.hpp>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "base/tls/wire.hpp"

namespace server::tls {

class StreamSocket {
 public:
  using executor_type = boost::asio::ip::tcp::socket::executor_type;
  using ErrorCode = boost::system::error_code;

  explicit StreamSocket(boost::asio::ip::tcp::socket socket);  // takes it over, plain

  executor_type get_executor() { return socket_.get_executor(); }
  boost::asio::ip::tcp::socket& tcp() { return socket_; }
  const std::string& peer() const { return peer_; }  // "192.0.2.7:4711"
  bool from_loopback() const { return from_loopback_; }
  bool is_secure() const { return wire_.is_secure(); }
  base::Wire& wire() { return wire_; }  // while it shakes hands nothing else uses the socket but end()

  // As much as the socket takes at once; the rest is dropped.
  void write_now(std::string_view bytes) { wire_.write(bytes.data(), bytes.size()); }

  template <class Buffers, class Token>
  auto async_read_some(const Buffers& into, Token&& token);
  template <class Buffers, class Token>
  auto async_write_some(const Buffers& bytes, Token&& token);

  // Returns when the client has closed its side, also only half of it, or after end(). What it sends ahead hides its
  // end; then only a reset counts.
  boost::asio::awaitable<void> peer_gone();

  // Gives the descriptor away, which the loop then knows no longer, and the wire over it.
  std::pair<int, base::Wire> release() &&;
  // Both directions; what is under way ends. The descriptor stays until the destructor: another thread may be using it.
  void end();

 private:
  template <class Try>
  class Operation;

  using Attempt = base::Wire::Attempt;

  template <class Buffers>
  Attempt write_gathered(const Buffers& bytes);
  static ErrorCode error_of(const Attempt& attempt);
  static boost::asio::mutable_buffer scratch();  // for what is written as one record; valid until the next call

  boost::asio::ip::tcp::socket socket_;
  base::Wire wire_;
  std::string peer_;
  bool from_loopback_ = false;
};

// Tries until it need not wait. Asio's rule holds: nothing completes before the call that began it has returned.
template <class Try>
class StreamSocket::Operation {
 public:
  Operation(StreamSocket& stream, Try attempt) : stream_{stream}, try_{std::move(attempt)} {}

  template <class Self>
  void operator()(Self& self, ErrorCode error = {}) {
    if (is_done_) return self.complete(error_of(last_), last_.size);
    if (error) return self.complete(error, 0);
    last_ = try_();
    if (last_.wait != base::Wire::Wait::none) {
      has_waited_ = true;
      auto& socket = stream_.socket_;
      const auto what = last_.wait == base::Wire::Wait::readable ? boost::asio::ip::tcp::socket::wait_read
                                                                 : boost::asio::ip::tcp::socket::wait_write;
      return socket.async_wait(what, std::move(self));
    }
    if (has_waited_) return self.complete(error_of(last_), last_.size);
    is_done_ = true;
    boost::asio::post(stream_.get_executor(), std::move(self));
  }

 private:
  StreamSocket& stream_;
  Try try_;
  Attempt last_;
  bool has_waited_ = false, is_done_ = false;
};

template <class Buffers>
StreamSocket::Attempt StreamSocket::write_gathered(const Buffers& bytes) {
  const auto first = boost::asio::buffer_sequence_begin(bytes);
  const boost::asio::const_buffer front = first == boost::asio::buffer_sequence_end(bytes)
                                              ? boost::asio::const_buffer{}
                                              : boost::asio::const_buffer{*first};
  if (front.size() == boost::asio::buffer_size(bytes)) return wire_.write(front.data(), front.size());
  const boost::asio::mutable_buffer record = scratch();
  return wire_.write(record.data(), boost::asio::buffer_copy(record, bytes));
}

template <class Buffers, class Token>
auto StreamSocket::async_read_some(const Buffers& into, Token&& token) {
  auto begin = [this](auto on_end, const Buffers& buffers) {
    if (!is_secure()) return socket_.async_read_some(buffers, std::move(on_end));
    auto attempt = [this, buffers] {
      auto at = boost::asio::buffer_sequence_begin(buffers);
      const auto end = boost::asio::buffer_sequence_end(buffers);
      while (at != end && boost::asio::mutable_buffer{*at}.size() == 0) ++at;
      if (at == end) return Attempt{};
      const boost::asio::mutable_buffer first{*at};
      return wire_.read(first.data(), first.size());
    };
    Operation operation{*this, std::move(attempt)};
    return boost::asio::async_compose<decltype(on_end), void(ErrorCode, std::size_t)>(std::move(operation), on_end,
                                                                                      socket_);
  };
  return boost::asio::async_initiate<Token, void(ErrorCode, std::size_t)>(std::move(begin), token, into);
}

template <class Buffers, class Token>
auto StreamSocket::async_write_some(const Buffers& bytes, Token&& token) {
  auto begin = [this](auto on_end, const Buffers& buffers) {
    if (!is_secure()) return socket_.async_write_some(buffers, std::move(on_end));
    auto attempt = [this, buffers] { return write_gathered(buffers); };
    Operation operation{*this, std::move(attempt)};
    return boost::asio::async_compose<decltype(on_end), void(ErrorCode, std::size_t)>(std::move(operation), on_end,
                                                                                      socket_);
  };
  return boost::asio::async_initiate<Token, void(ErrorCode, std::size_t)>(std::move(begin), token, bytes);
}

// Beast ends a WebSocket by these: the peer reads the end, then TCP is closed as Beast closes it; or at once.
template <class OnEnd>
void async_teardown(boost::beast::role_type role, StreamSocket& stream, OnEnd&& on_end) {
  if (stream.is_secure()) stream.wire().end_sending();
  boost::beast::websocket::async_teardown(role, stream.tcp(), std::forward<OnEnd>(on_end));
}
inline void beast_close_socket(StreamSocket& stream) { stream.end(); }

}  // namespace server::tls
