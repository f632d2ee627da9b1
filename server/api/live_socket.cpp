// The WebSocket of one page.
#include "server/api/live_socket.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <boost/asio/as_tuple.hpp>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/beast/core/buffers_to_string.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/websocket.hpp>
#include <optional>

#include "server/api/bodies/json.hpp"
#include "server/api/close_frame.hpp"
#include "server/api/peer_watch.hpp"
#include "server/runtime/secrets.hpp"

namespace server::api {
namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = boost::beast::websocket;
using namespace asio::experimental::awaitable_operators;  // NOLINT: operators only

namespace {

class LivePage {
 public:
  LivePage(http::HttpStream stream, identity::Caller caller, LiveParts& parts)
      : socket_{std::move(stream)}, caller_{std::move(caller)}, parts_{parts}, queue_{parts.loop}, peer_{parts.clock} {
    websocket::stream_base::timeout none;  // time is the injected clock's business
    none.handshake_timeout = none.idle_timeout = websocket::stream_base::none();
    none.keep_alive_pings = false;
    socket_.set_option(none);
    socket_.read_message_max(kMaxMessageBytes);
    socket_.text(true);
    socket_.auto_fragment(false);  // what is long is written in pieces already
    auto on_control = [this](websocket::frame_type, beast::string_view) { peer_.on_received(); };
    socket_.control_callback(std::move(on_control));
  }
  ~LivePage() {
    parts_.live.remove(queue_);
    leave_client();
    if (closing_) write_close_frame(socket_.next_layer(), peer_, *closing_);
  }
  LivePage(const LivePage&) = delete;
  LivePage& operator=(const LivePage&) = delete;

  asio::awaitable<void> run(http::UpgradeRequest upgrade) {
    take_client(http::Target{std::string{upgrade.target()}});
    const auto [error] = co_await socket_.async_accept(upgrade, asio::as_tuple(asio::use_awaitable));
    if (error) co_return;
    closing_.emplace();       // how a task ends that is cancelled
    parts_.live.add(queue_);  // what changes while the welcome is written is queued after it
    co_await (part(read()) || part(write()) || part(watch()) || caller_.standing->wait_for_end());
    const bool is_cancelled =
        (co_await asio::this_coro::cancellation_state).cancelled() != asio::cancellation_type::none;
    if (!is_cancelled && closing_ && closing_->code == CloseCode::going_away) closing_ = kFault;
    if (!caller_.standing->ended()) co_return;
    closing_ = kSignedOut;
    spdlog::info("the page of {} was signed out", caller_.actor);
  }

 private:
  // The id by which the page goes: the one that it asks for, or a new one while another page has that.
  // SAFETY: a tab and its copy are two clients.
  void take_client(const http::Target& target) {
    std::string page;
    for (const auto& [name, value] : target.query().value_or(http::Target::Query{})) {
      if (name == "client" && identity::is_client_id(value)) caller_.client = value;
      if (name == "page" && identity::is_client_id(value)) page = value;
    }
    if (caller_.client.empty()) return;
    const auto other = parts_.clients.find(client_key());
    if (other != parts_.clients.end() && (page.empty() || other->second.page != page))
      caller_.client = runtime::random_secret();
    OpenClient& open = parts_.clients[client_key()];
    open.page = std::move(page);
    ++open.connections;
    has_client_ = true;
  }
  void leave_client() {
    if (!has_client_) return;
    const auto open = parts_.clients.find(client_key());
    if (open != parts_.clients.end() && --open->second.connections == 0) parts_.clients.erase(open);
  }
  std::string client_key() const { return caller_.actor + " " + caller_.client; }

  // By an exception the page ends: its other parts do not go on without this one.
  asio::awaitable<void> part(asio::awaitable<void> task) {
    return contained(parts_.tasks.exceptions(), parts_.clock, runtime::Ended::live_page, "page of " + caller_.actor,
                     std::move(task));
  }

  // The boundary: a message that cannot be acted on ends neither the page nor the station.
  Result<void> act_on(const std::string& text) {
    try {
      const identity::Scope needed = scope_needed_by(text);
      if (auto permitted = check_permission(needed); !permitted) return permitted;
      // SAFETY: what came in one turn of the loop with the end of its right is nobody's; a stop is carried out.
      if (auto stands = still_stands(caller_); !stands && needed != identity::Scope::stop) return stands;
      return on_page_message(text, caller_, queue_, parts_);
    } catch (...) {
      parts_.tasks.exceptions().note(runtime::Ended::request, "a message of " + caller_.actor + " on /live",
                                     std::current_exception(), parts_.clock.steady_us());
      return fail(ErrorCode::internal, "the station could not act on this message; its log says why", "internal");
    }
  }

  Result<void> check_permission(identity::Scope needed) const {
    if (caller_.scopes.allow(needed)) return {};
    return fail(ErrorCode::forbidden,
                fmt::format("this message needs the role {}; {} has the role {}", identity::text(least_role(needed)),
                            caller_.actor, identity::text(caller_.role())),
                "not_permitted");
  }

  // The other end has closed the connection, or it broke, unless this task was cancelled.
  void leave(boost::system::error_code error) {
    if (error != asio::error::operation_aborted) closing_.reset();
  }

  asio::awaitable<void> read() {
    beast::flat_buffer buffer{kMaxMessageBytes};
    for (;;) {
      const auto [error, size] = co_await socket_.async_read(buffer, asio::as_tuple(asio::use_awaitable));
      if (error) co_return leave(error);
      peer_.on_received();
      // Each of its messages may become a task.
      if (peer_.is_too_talkative()) co_await parts_.clock.sleep_until(peer_.resume_at_us());
      const std::string text = beast::buffers_to_string(buffer.data());
      const auto understood = act_on(text);
      buffer.clear();
      if (!understood) {
        parts_.station.note_refusal({caller_.actor, caller_.peer, parts_.clock.utc_us()}, "", "command", "{}",
                                    understood.error());
        queue_.push(std::make_shared<const std::string>(problem_message(understood.error(), scope_needed_by(text))),
                    true);
      }
    }
  }

  // One message, in as many frames as it has pieces.
  asio::awaitable<boost::system::error_code> write_welcome() {
    live::RobotDocument welcome = welcome_message(caller_, parts_);
    while (!welcome.is_whole()) {
      const std::string piece = co_await welcome.next();
      queue_.forget_states(welcome.after(), welcome.last());
      peer_.on_write_begun();
      const auto [error, size] = co_await socket_.async_write_some(welcome.is_whole(), asio::buffer(piece),
                                                                   asio::as_tuple(asio::use_awaitable));
      if (!error) peer_.on_written();
      if (error) co_return error;
    }
    co_return boost::system::error_code{};
  }

  asio::awaitable<void> write() {
    const auto failed = co_await write_welcome();
    if (failed) co_return leave(failed);
    for (;;) {
      co_await queue_.wait();
      for (live::LiveText message = queue_.pop(); message != nullptr; message = queue_.pop()) {
        if (!parts_.turns.take()) co_await parts_.turns.wait();
        peer_.on_write_begun();
        const auto [error, size] =
            co_await socket_.async_write(asio::buffer(*message), asio::as_tuple(asio::use_awaitable));
        if (!error) peer_.on_written();
        if (error) co_return leave(error);
      }
      if (!peer_.take_ping()) continue;
      const websocket::ping_data empty;
      peer_.on_write_begun();
      const auto [error] = co_await socket_.async_ping(empty, asio::as_tuple(asio::use_awaitable));
      if (!error) peer_.on_written();
      if (error) co_return leave(error);
    }
  }

  // A page that says things and reads nothing is as good as gone, and would keep its queue for ever.
  asio::awaitable<void> watch() {
    const auto nothing = [] {};
    co_await peer_.wait_for_silence(nothing);
    closing_ = kSilent;
    spdlog::info("the page of {} fell silent, or does not read", caller_.actor);
  }

  websocket::stream<http::HttpStream> socket_;
  identity::Caller caller_;
  bool has_client_ = false;  // it is counted under its id
  LiveParts& parts_;
  live::Subscriber queue_;
  PeerWatch peer_;
  std::optional<Closing> closing_;  // what to end with; none: the other end has closed the connection
};

}  // namespace

asio::awaitable<void> serve_live(http::HttpStream stream, http::UpgradeRequest upgrade, identity::Caller caller,
                                 LiveParts& parts) {
  LivePage page{std::move(stream), std::move(caller), parts};
  co_await page.run(std::move(upgrade));
}

}  // namespace server::api
