// The WebSocket of one Foxglove client.
#include "server/api/foxglove_socket.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <boost/asio/as_tuple.hpp>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/beast/core/buffers_to_string.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/websocket.hpp>
#include <optional>

#include "server/api/close_frame.hpp"
#include "server/api/peer_watch.hpp"
#include "server/http/target.hpp"

namespace server::api {
namespace asio = boost::asio;
namespace beast = boost::beast;
namespace foxglove = live::foxglove;
namespace websocket = boost::beast::websocket;
using namespace asio::experimental::awaitable_operators;  // NOLINT: operators only

namespace {

constexpr std::array<std::string_view, 2> kProtocols{"foxglove.websocket.v1", "foxglove.sdk.v1"};

std::optional<station::RobotId> robot_of(const http::UpgradeRequest& upgrade) {
  const auto query = http::Target{std::string{upgrade.target()}}.query();
  if (!query) return std::nullopt;
  for (const auto& [name, value] : *query) {
    if (name == "robot") return value;
  }
  return std::nullopt;
}

class FoxgloveClient {
 public:
  FoxgloveClient(http::HttpStream stream, identity::Caller caller, const http::UpgradeRequest& upgrade,
                 FoxgloveClients& clients)
      : socket_{std::move(stream)},
        caller_{std::move(caller)},
        clients_{clients},
        parts_{clients.live},
        session_{parts_.loop, parts_.clock, robot_of(upgrade)},
        peer_{parts_.clock} {
    websocket::stream_base::timeout none;  // time is the injected clock's business
    none.handshake_timeout = none.idle_timeout = websocket::stream_base::none();
    none.keep_alive_pings = false;
    socket_.set_option(none);
    const std::string protocol = foxglove_protocol(std::string{upgrade[beast::http::field::sec_websocket_protocol]});
    socket_.set_option(websocket::stream_base::decorator{[protocol](websocket::response_type& response) {
      response.set(beast::http::field::sec_websocket_protocol, protocol);
    }});
    socket_.read_message_max(foxglove::kMaxClientMessageBytes);
    socket_.auto_fragment(false);
    auto on_control = [this](websocket::frame_type, beast::string_view) { peer_.on_received(); };
    socket_.control_callback(std::move(on_control));
  }
  ~FoxgloveClient() {
    clients_.feed.remove(session_);
    if (closing_) write_close_frame(socket_.next_layer(), peer_, *closing_);
  }
  FoxgloveClient(const FoxgloveClient&) = delete;
  FoxgloveClient& operator=(const FoxgloveClient&) = delete;

  asio::awaitable<void> run(http::UpgradeRequest upgrade) {
    const auto [error] = co_await socket_.async_accept(upgrade, asio::as_tuple(asio::use_awaitable));
    if (error) co_return;
    closing_.emplace();  // how a task ends that is cancelled
    spdlog::info("Foxglove client of {} from {}", caller_.actor, caller_.peer);
    session_.begin("Rheonaut " + parts_.version, clients_.station_start);
    clients_.feed.add(session_, parts_.station.robots());
    co_await (part(read()) || part(write()) || part(watch()) || caller_.standing->wait_for_end());
    const bool is_cancelled =
        (co_await asio::this_coro::cancellation_state).cancelled() != asio::cancellation_type::none;
    if (!is_cancelled && closing_ && closing_->code == CloseCode::going_away) closing_ = kFault;
    if (!caller_.standing->ended()) co_return;
    closing_ = kSignedOut;
    spdlog::info("the Foxglove client of {} was signed out", caller_.actor);
  }

 private:
  // By an exception the client's connection ends: its other parts do not go on without this one.
  asio::awaitable<void> part(asio::awaitable<void> task) {
    return contained(parts_.tasks.exceptions(), parts_.clock, runtime::Ended::live_page,
                     "Foxglove client of " + caller_.actor, std::move(task));
  }

  // The other end has closed the connection, or it broke, unless this task was cancelled.
  void leave(boost::system::error_code error) {
    if (error != asio::error::operation_aborted) closing_.reset();
  }

  asio::awaitable<void> read() {
    beast::flat_buffer buffer{foxglove::kMaxClientMessageBytes};
    for (;;) {
      const auto [error, size] = co_await socket_.async_read(buffer, asio::as_tuple(asio::use_awaitable));
      if (error) co_return leave(error);
      peer_.on_received();
      if (peer_.is_too_talkative()) co_await parts_.clock.sleep_until(peer_.resume_at_us());
      const std::string message = beast::buffers_to_string(buffer.data());
      buffer.clear();
      if (!parts_.turns.take()) co_await parts_.turns.wait();
      if (socket_.got_text()) {
        session_.on_text(message);
      } else {
        session_.on_binary(message);
      }
    }
  }

  asio::awaitable<boost::system::error_code> send(const foxglove::Outgoing& outgoing) {
    if (!parts_.turns.take()) co_await parts_.turns.wait();
    const std::array pieces{outgoing.head ? asio::buffer(*outgoing.head) : asio::const_buffer{},
                            asio::buffer(*outgoing.body)};
    socket_.binary(outgoing.head.has_value());
    peer_.on_write_begun();
    const auto [error, size] = co_await socket_.async_write(pieces, asio::as_tuple(asio::use_awaitable));
    if (!error) peer_.on_written();
    co_return error;
  }

  asio::awaitable<void> write() {
    foxglove::OutgoingQueue& queue = session_.queue();
    for (;;) {
      co_await queue.wait();
      for (auto outgoing = queue.pop(); outgoing; outgoing = queue.pop()) {
        const auto failed = co_await send(*outgoing);
        if (failed) co_return leave(failed);
        if (!queue.is_overrun()) continue;
        closing_ = kTooSlow;
        co_return;
      }
      if (!peer_.take_ping()) continue;
      const websocket::ping_data empty;
      peer_.on_write_begun();
      const auto [error] = co_await socket_.async_ping(empty, asio::as_tuple(asio::use_awaitable));
      if (!error) peer_.on_written();
      if (error) co_return leave(error);
    }
  }

  // Wakes the writer each second, for it may be time for a ping.
  asio::awaitable<void> watch() {
    const auto wake = [this] { session_.queue().wake(); };
    co_await peer_.wait_for_silence(wake);
    closing_ = kSilent;
    spdlog::info("the Foxglove client of {} fell silent, or does not read", caller_.actor);
  }

  websocket::stream<http::HttpStream> socket_;
  identity::Caller caller_;
  FoxgloveClients& clients_;
  LiveParts& parts_;
  foxglove::Session session_;
  PeerWatch peer_;
  std::optional<Closing> closing_;  // what to end with; none: the other end has closed the connection
};

}  // namespace

std::string foxglove_protocol(const std::string& offered) {
  std::string without_blanks = offered;
  std::erase(without_blanks, ' ');
  const std::vector<std::string> words = http::split(without_blanks, ',');
  for (const std::string_view known : kProtocols) {
    if (std::ranges::find(words, known) != words.end()) return std::string{known};
  }
  return "";
}

asio::awaitable<void> serve_foxglove(http::HttpStream stream, http::UpgradeRequest upgrade, identity::Caller caller,
                                     FoxgloveClients& clients) {
  FoxgloveClient client{std::move(stream), std::move(caller), upgrade, clients};
  co_await client.run(std::move(upgrade));
}

}  // namespace server::api
