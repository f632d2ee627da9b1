// Waits on the loop, computes on the worker.
#include "server/tls/tls_handshakes.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>

#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/system/system_error.hpp>

namespace server::tls {
namespace asio = boost::asio;
using asio::ip::tcp;
using namespace asio::experimental::awaitable_operators;  // NOLINT: operators only

namespace {

constexpr std::uint8_t kHandshakeRecord = 22;  // RFC 8446, 5.1: the first byte of each client

}  // namespace

asio::awaitable<TlsHandshakes::Outcome> TlsHandshakes::secure(StreamSocket& socket, const char* port) {
  End end{Outcome::failed, fmt::format("not done within {} s", kHandshakeTime / std::chrono::seconds{1})};
  try {
    auto first = co_await (shake_hands(socket) || clock_.sleep_for(kHandshakeTime));
    if (first.index() == 0) end = std::get<0>(std::move(first));
  } catch (const boost::system::system_error& error) {
    if (error.code() == asio::error::operation_aborted) throw;
    end.failure = error.code().message();
  }
  if (end.outcome == Outcome::secure) {
    ++counters_.handshakes;
    if (socket.wire().was_resumed()) ++counters_.resumed;
  } else {
    ++counters_.failed;
    log_failure(socket.peer(), port, end.failure);
  }
  co_return end.outcome;
}

asio::awaitable<TlsHandshakes::End> TlsHandshakes::shake_hands(StreamSocket& socket) {
  co_await socket.tcp().async_wait(tcp::socket::wait_read, asio::use_awaitable);
  base::Wire& wire = socket.wire();
  std::uint8_t first = 0;
  if (::recv(socket.tcp().native_handle(), &first, 1, MSG_PEEK | MSG_DONTWAIT) != 1) {
    co_return End{Outcome::failed, "closed before it began"};
  }
  if (first != kHandshakeRecord) co_return End{Outcome::not_tls, "the client does not speak TLS"};
  wire.begin_tls(*context_->ssl);
  for (;;) {
    auto step = [&wire] { return wire.shake_hands(); };
    const base::Wire::Handshake reached = co_await worker_.run_unless_cancelled(std::move(step));
    if (!reached.failure.empty()) co_return End{Outcome::failed, reached.failure};
    if (reached.wait == base::Wire::Wait::none) co_return End{};
    const auto what = reached.wait == base::Wire::Wait::readable ? tcp::socket::wait_read : tcp::socket::wait_write;
    co_await socket.tcp().async_wait(what, asio::use_awaitable);
  }
}

void TlsHandshakes::log_failure(const std::string& peer, const char* port, const std::string& why) {
  const auto unsaid = lines_.next(clock_.steady_us());
  if (unsaid) spdlog::warn("{}: no TLS with {}: {}{}", port, peer, why, runtime::and_before(*unsaid));
}

}  // namespace server::tls
