// Reads and writes HTTP/1.1 with Beast; the only unit of the simulator that knows it.
#include "sim_robot/client/fault_server.hpp"

#include <array>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http.hpp>
#include <charconv>
#include <stdexcept>

#include "sim_robot/client/listening.hpp"
#include "sim_robot/client/no_throw.hpp"
#include "sim_robot/scenario/fault_requests.hpp"

namespace sim_robot {
namespace {

namespace asio = boost::asio;
namespace http = boost::beast::http;
using asio::ip::tcp;

constexpr std::size_t kMaxHeaderBytes = 8 * 1024, kMaxBodyBytes = 16 * 1024;
constexpr std::chrono::seconds kPauseAfterFailure{1}, kLingerTime{1};
constexpr std::size_t kMaxDiscardBytes = 1024 * 1024;

using HttpRequest = http::request<http::string_body>;

FaultRequest plain(const HttpRequest& message) {
  return {message.method_string(),      message.target(),
          message[http::field::host],   message[http::field::content_type],
          message[http::field::origin], message.body()};
}

FaultAnswer unreadable(const boost::system::error_code& error) {
  if (error == http::error::header_limit) {
    return fault_problem(431, "too_large", "the header has more than " + std::to_string(kMaxHeaderBytes) + " bytes");
  }
  if (error == http::error::body_limit) {
    return fault_problem(413, "too_large", "the body has more than " + std::to_string(kMaxBodyBytes) + " bytes");
  }
  return fault_problem(400, "malformed_http", "this is not HTTP/1.1: " + error.message());
}

http::response<http::string_body> packed(FaultAnswer answer) {
  http::response<http::string_body> message{static_cast<http::status>(answer.status), 11};
  if (answer.status != 204) message.set(http::field::content_type, "application/json");
  message.set(http::field::cache_control, "no-store");
  message.keep_alive(false);
  message.body() = std::move(answer.body);
  message.prepare_payload();
  return message;
}

bool is_unspoken(const boost::system::error_code& error) {
  static const auto& http_category = http::make_error_code(http::error::bad_method).category();
  return error.category() != http_category || error == http::error::end_of_stream ||
         error == http::error::partial_message;
}

// Closing with unread bytes would reset the connection and could destroy the answer on its way.
asio::awaitable<void> close_after_reading(boost::beast::tcp_stream& stream) {
  boost::system::error_code ignored;
  stream.socket().shutdown(tcp::socket::shutdown_send, ignored);
  stream.expires_after(kLingerTime);
  std::array<char, 4096> rest;
  for (std::size_t total = 0; total < kMaxDiscardBytes;) {
    const auto [error, size] = co_await stream.async_read_some(asio::buffer(rest), kNoThrow);
    if (error) co_return;
    total += size;
  }
}

}  // namespace

tcp::endpoint parse_faults_address(const std::string& text, bool anywhere) {
  const std::size_t colon = text.rfind(':');
  if (colon == std::string::npos) throw std::invalid_argument("--faults: '" + text + "' is not ADDR:PORT");
  std::string host = text.substr(0, colon);
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') host = host.substr(1, host.size() - 2);
  if (host == "localhost") host = "127.0.0.1";
  boost::system::error_code error;
  const asio::ip::address address = asio::ip::make_address(host, error);
  if (error) throw std::invalid_argument("--faults: '" + host + "' is not an address such as 127.0.0.1 or [::1]");
  std::uint16_t port = 0;
  const char* const last = text.data() + text.size();
  const auto [end, port_error] = std::from_chars(text.data() + colon + 1, last, port);
  if (port_error != std::errc{} || end != last) {
    throw std::invalid_argument("--faults: '" + text.substr(colon + 1) + "' is not a port; 0 is any");
  }
  if (!address.is_loopback() && !anywhere) {
    throw std::invalid_argument("--faults: whoever reaches " + host +
                                " could do faults to the robot; use 127.0.0.1, or add --faults-anywhere");
  }
  return {address, port};
}

FaultServer::FaultServer(asio::io_context& loop, const tcp::endpoint& at, FaultTimeline& faults, FaultyRobot robot,
                         std::chrono::milliseconds time)
    : acceptor_(listen_on(loop, at)), faults_(faults), robot_(robot), time_(time) {}

asio::awaitable<void> FaultServer::run() {
  for (;;) {
    auto [error, socket] = co_await acceptor_.async_accept(kNoThrow);
    if (error == asio::error::operation_aborted) co_return;
    if (error) {
      asio::steady_timer pause{acceptor_.get_executor(), kPauseAfterFailure};
      co_await pause.async_wait(asio::use_awaitable);
      continue;
    }
    co_await serve(std::move(socket));
  }
}

asio::awaitable<void> FaultServer::serve(tcp::socket socket) {
  boost::beast::tcp_stream stream{std::move(socket)};
  boost::beast::flat_buffer buffer{kMaxHeaderBytes + kMaxBodyBytes};
  http::request_parser<http::string_body> parser;
  parser.header_limit(kMaxHeaderBytes);
  parser.body_limit(kMaxBodyBytes);
  stream.expires_after(time_);
  const auto [error, size] = co_await http::async_read(stream, buffer, parser, kNoThrow);
  if (error && is_unspoken(error)) co_return;
  const http::response<http::string_body> message =
      packed(error ? unreadable(error) : answer(plain(parser.get()), faults_, robot_));
  stream.expires_after(time_);
  const auto [write_error, written] = co_await http::async_write(stream, message, kNoThrow);
  if (!write_error) co_await close_after_reading(stream);
}

}  // namespace sim_robot
