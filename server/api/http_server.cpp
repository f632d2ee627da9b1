// Reads and writes HTTP/1.1 with Beast; the only unit besides live_socket.cpp that knows it.
#include "server/api/http_server.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/as_tuple.hpp>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/multiple_exceptions.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <cctype>
#include <limits>
#include <variant>

#include "server/api/contained.hpp"
#include "server/api/live_socket.hpp"
#include "server/counted.hpp"

namespace server {
namespace asio = boost::asio;
namespace http = boost::beast::http;
using asio::ip::tcp;
using namespace asio::experimental::awaitable_operators;  // NOLINT: operators only

namespace {

constexpr auto kNever = std::numeric_limits<std::int64_t>::max();
constexpr microseconds kWatchInterval{std::chrono::seconds{1}};  // how exactly time-outs are kept
constexpr std::size_t kReadBytes = 4096;
constexpr std::size_t kMaxDiscardBytes = 1024 * 1024;

constexpr const char* kContentSecurityPolicy =
    "default-src 'self'; connect-src 'self'; style-src 'self'; img-src 'self' data:; base-uri 'none'; "
    "form-action 'self'; frame-ancestors 'none'";

using HttpRequest = http::request<http::string_body>;

Request plain_request(const HttpRequest& message) {
  Request request;
  request.method = message.method_string();
  request.target = message.target();
  request.body = message.body();
  for (const auto& field : message) {
    std::string name = field.name_string();
    std::ranges::transform(name, name.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    std::string& value = request.headers[name];
    if (!value.empty()) value += name == "cookie" ? "; " : ", ";
    value += field.value();
  }
  return request;
}

// One connection: requests and answers in turn, until it ends or asks for /live.
class Connection {
 public:
  Connection(HttpStream stream, TlsGate* tls, Clock& clock, const RequestGuard& guard, const Router& router,
             std::list<HttpStream*>& strangers)
      : stream_{std::move(stream)}, tls_{tls}, clock_{clock}, guard_{guard}, router_{router}, strangers_{strangers} {
    strangers_.push_back(&stream_);
  }
  ~Connection() { strangers_.remove(&stream_); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  asio::awaitable<void> talk();
  asio::awaitable<void> watch();  // ends when the deadline of whatever talk() waits for has passed

  bool wants_live() const { return upgrade_.has_value(); }
  HttpStream take_stream() { return std::move(stream_); }
  UpgradeRequest take_upgrade() { return std::move(*upgrade_); }
  const Caller& caller() const { return caller_; }

 private:
  enum class Next : std::uint8_t { another, end };

  asio::awaitable<Next> secure();
  asio::awaitable<Next> read_and_answer();
  asio::awaitable<Next> refuse_unreadable(boost::system::error_code error);
  asio::awaitable<Response> answer(Request request);
  template <class T>
  asio::awaitable<std::optional<T>> while_present(asio::awaitable<T> work);
  asio::awaitable<Next> send(Response response, const HttpRequest& to);
  asio::awaitable<Next> send_body(http::response<http::string_body> message);
  asio::awaitable<Next> send_stream(http::response<http::empty_body> head, std::unique_ptr<BodyStream> body);
  asio::awaitable<Result<std::optional<std::string>>> next_piece(BodyStream& body);
  asio::awaitable<void> discard_rest();

  bool wants_live(const HttpRequest& message) const;
  void allow(microseconds duration) { deadline_us_ = clock_.steady_us() + duration.count(); }

  HttpStream stream_;
  TlsGate* tls_;  // null: plain HTTP
  Clock& clock_;
  const RequestGuard& guard_;
  const Router& router_;
  std::list<HttpStream*>& strangers_;
  boost::beast::flat_buffer buffer_{kMaxHeaderBytes + kMaxBodyBytes};
  std::int64_t deadline_us_ = kNever;
  bool request_has_begun_ = false;
  std::optional<UpgradeRequest> upgrade_;
  Caller caller_;  // of the page
};

asio::awaitable<void> Connection::talk() {
  allow(kRequestTime);
  try {
    const Next begun = co_await secure();
    if (begun == Next::end) co_return;
    for (;;) {
      const Next next = co_await read_and_answer();
      if (next == Next::end) co_return;
      allow(kIdleTime);
    }
  } catch (const boost::system::system_error& error) {
    if (error.code() == asio::error::operation_aborted) throw;
    spdlog::error("an http connection ended: {}", error.what());
  } catch (const std::exception& error) {  // ends this connection, never the station
    spdlog::error("an http connection ended: {}", error.what());
  }
}

asio::awaitable<void> Connection::watch() {
  while (clock_.steady_us() < deadline_us_) co_await clock_.sleep_for(kWatchInterval);
  if (request_has_begun_) {
    const std::string late = "HTTP/1.1 408 Request Timeout\r\nConnection: close\r\nContent-Length: 0\r\n\r\n";
    stream_.write_now(asio::buffer(late));
  }
  stream_.end();
}

asio::awaitable<Connection::Next> Connection::secure() {
  if (tls_ == nullptr) co_return Next::another;
  const TlsGate::Outcome outcome = co_await tls_->secure(stream_, "http port");
  if (outcome == TlsGate::Outcome::secure) co_return Next::another;
  if (outcome == TlsGate::Outcome::not_tls) {
    const std::string detail = "This port speaks TLS only: use https:// instead of http://.\n";
    stream_.write_now(asio::buffer(
        fmt::format("HTTP/1.1 400 Bad Request\r\nConnection: close\r\nContent-Type: text/plain\r\nContent-Length: "
                    "{}\r\n\r\n{}",
                    detail.size(), detail)));
    co_await discard_rest();
  }
  co_return Next::end;
}

bool Connection::wants_live(const HttpRequest& message) const {
  return path_of(message.target()) == "/live" && boost::beast::websocket::is_upgrade(message) && buffer_.size() == 0;
}

asio::awaitable<Connection::Next> Connection::read_and_answer() {
  if (buffer_.size() == 0) {
    const auto [error, size] =
        co_await stream_.async_read_some(buffer_.prepare(kReadBytes), asio::as_tuple(asio::use_awaitable));
    if (error) co_return Next::end;
    buffer_.commit(size);
  }
  allow(kRequestTime);
  request_has_begun_ = true;
  http::request_parser<http::string_body> parser;
  parser.header_limit(kMaxHeaderBytes);
  parser.body_limit(kMaxBodyBytes);
  auto [error, size] = co_await http::async_read_header(stream_, buffer_, parser, asio::as_tuple(asio::use_awaitable));
  if (!error && parser.get()[http::field::expect] == "100-continue") {
    const std::string go_on = "HTTP/1.1 100 Continue\r\n\r\n";
    co_await asio::async_write(stream_, asio::buffer(go_on), asio::as_tuple(asio::use_awaitable));
  }
  if (!error && !parser.is_done()) {
    auto [body_error, body_size] =
        co_await http::async_read(stream_, buffer_, parser, asio::as_tuple(asio::use_awaitable));
    error = body_error;
  }
  request_has_begun_ = false;
  if (error) co_return co_await refuse_unreadable(error);

  deadline_us_ = kNever;  // a route bounds its own waits
  const HttpRequest message = parser.release();
  Request request = plain_request(message);
  request.received_us = clock_.steady_us();
  auto admitted = guard_.admit(request);
  if (!admitted) co_return co_await send(std::move(admitted.error()), message);
  if (!admitted->actor.empty()) strangers_.remove(&stream_);
  if (wants_live(message)) {
    upgrade_.emplace(message.base());
    caller_ = std::move(*admitted);
    co_return Next::end;
  }
  request.caller = std::move(*admitted);
  request.actor = request.caller.actor;
  request.peer = address_of(stream_);
  // SAFETY: what changes something, above all a stop, is carried out though its client has hung up.
  if (request.method != "GET" && request.method != "HEAD") {
    Response response = co_await answer(std::move(request));
    co_return co_await send(std::move(response), message);
  }
  auto response = co_await while_present(answer(std::move(request)));
  if (!response) co_return Next::end;
  co_return co_await send(std::move(*response), message);
}

// What the work gives, or nothing when the client goes first: the work is cancelled then, and has ended.
template <class T>
asio::awaitable<std::optional<T>> Connection::while_present(asio::awaitable<T> work) {
  try {
    std::variant<T, std::monostate> first = co_await (std::move(work) || stream_.peer_gone());
    if (first.index() == 0) co_return std::move(std::get<0>(first));
    co_return std::nullopt;
  } catch (const asio::multiple_exceptions&) {  // both were cancelled: the station stops, or the time is over
    throw boost::system::system_error{asio::error::operation_aborted};
  }
}

// Says why, if the client spoke at all, and gives it the time to read that.
asio::awaitable<Connection::Next> Connection::refuse_unreadable(boost::system::error_code error) {
  static const auto& http_category = http::make_error_code(http::error::bad_method).category();
  if (error.category() != http_category || error == http::error::end_of_stream ||
      error == http::error::partial_message) {
    co_return Next::end;
  }
  Response response = problem(400, "this is not HTTP/1.1: " + error.message(), "malformed_http");
  if (error == http::error::header_limit) {
    response = problem(431, fmt::format("the header has more than {} bytes", kMaxHeaderBytes), "too_large");
  } else if (error == http::error::body_limit) {
    response = problem(413, fmt::format("the body has more than {} bytes", kMaxBodyBytes), "too_large");
  }
  HttpRequest unreadable;
  unreadable.version(11);
  unreadable.keep_alive(false);
  co_await send(std::move(response), unreadable);
  co_await discard_rest();
  co_return Next::end;
}

// Closing with unread bytes would reset the connection and could destroy the answer on its way.
asio::awaitable<void> Connection::discard_rest() {
  stream_.end_sending();
  allow(kLingerTime);
  buffer_.clear();
  std::size_t discarded = 0;
  while (discarded < kMaxDiscardBytes) {
    const auto [error, size] =
        co_await stream_.async_read_some(buffer_.prepare(kReadBytes), asio::as_tuple(asio::use_awaitable));
    if (error) co_return;
    discarded += size;
  }
}

// The boundary: whatever a route throws ends here, and says nothing of the inside to the outside.
asio::awaitable<Response> Connection::answer(Request request) {
  const std::string what = request.method + " " + request.target.substr(0, 200);
  try {
    co_return co_await router_.dispatch(std::move(request));
  } catch (const boost::system::system_error& error) {
    if (error.code() == asio::error::operation_aborted) throw;
    spdlog::error("{}: {}", what, error.what());
  } catch (const std::exception& error) {
    spdlog::error("{}: {}", what, error.what());
  }
  co_return problem(500, "the station could not answer; its log says why", "internal");
}

template <class Message>
void set_common_fields(Message& message, const Response& response, const HttpRequest& to, bool is_secure) {
  message.version(to.version());
  message.result(static_cast<unsigned>(response.status));
  message.reason(reason_phrase(response.status));
  message.set(http::field::server, "rheonaut");
  message.set("Content-Security-Policy", kContentSecurityPolicy);
  message.set("X-Content-Type-Options", "nosniff");
  message.set("X-Frame-Options", "DENY");
  message.set("Referrer-Policy", "no-referrer");
  message.set("Cross-Origin-Opener-Policy", "same-origin");
  message.set("Cross-Origin-Resource-Policy", "same-origin");
  // Browsers keep it for the name with all its ports, and other programs of this machine are localhost, too.
  if (is_secure && !to[http::field::host].starts_with("localhost")) {
    message.set(http::field::strict_transport_security, "max-age=31536000");
  }
  if (!response.content_type.empty()) message.set(http::field::content_type, response.content_type);
  for (const auto& [name, value] : response.headers) message.insert(name, value);
  message.keep_alive(to.keep_alive());
}

asio::awaitable<Connection::Next> Connection::send(Response response, const HttpRequest& to) {
  const bool head_only = to.method() == http::verb::head;
  if (response.stream != nullptr && !head_only) {
    http::response<http::empty_body> head;
    set_common_fields(head, response, to, stream_.is_secure());
    if (to.version() >= 11) {
      head.chunked(true);
    } else {
      head.keep_alive(false);
    }
    co_return co_await send_stream(std::move(head), std::move(response.stream));
  }
  http::response<http::string_body> message;
  set_common_fields(message, response, to, stream_.is_secure());
  if (response.status != 304 && response.stream == nullptr) message.content_length(response.body.size());
  if (!head_only) message.body() = std::move(response.body);
  co_return co_await send_body(std::move(message));
}

asio::awaitable<Connection::Next> Connection::send_body(http::response<http::string_body> message) {
  allow(kWriteTime);
  const auto [error, size] = co_await http::async_write(stream_, message, asio::as_tuple(asio::use_awaitable));
  co_return error || !message.keep_alive() ? Next::end : Next::another;
}

asio::awaitable<Connection::Next> Connection::send_stream(http::response<http::empty_body> head,
                                                          std::unique_ptr<BodyStream> body) {
  allow(kWriteTime);
  http::response_serializer<http::empty_body> serializer{head};
  const auto [head_error, head_size] =
      co_await http::async_write_header(stream_, serializer, asio::as_tuple(asio::use_awaitable));
  if (head_error) co_return Next::end;
  const bool chunked = head.chunked();
  for (;;) {
    deadline_us_ = kNever;
    const auto made = co_await while_present(next_piece(*body));
    if (!made || !*made) co_return Next::end;  // the missing last chunk tells the client
    const std::optional<std::string>& piece = **made;
    if (!piece) break;
    if (piece->empty()) continue;
    allow(kWriteTime);
    boost::system::error_code error;
    const auto bytes = asio::buffer(*piece);
    if (chunked) {
      std::tie(error, std::ignore) =
          co_await asio::async_write(stream_, http::make_chunk(bytes), asio::as_tuple(asio::use_awaitable));
    } else {
      std::tie(error, std::ignore) = co_await asio::async_write(stream_, bytes, asio::as_tuple(asio::use_awaitable));
    }
    if (error) co_return Next::end;
  }
  if (!chunked) co_return Next::end;
  allow(kWriteTime);
  const auto [error, size] =
      co_await asio::async_write(stream_, http::make_chunk_last(), asio::as_tuple(asio::use_awaitable));
  co_return error || !head.keep_alive() ? Next::end : Next::another;
}

asio::awaitable<Result<std::optional<std::string>>> Connection::next_piece(BodyStream& body) {
  std::string failure;
  try {
    auto piece = co_await body.next();
    if (piece) co_return piece;
    failure = piece.error().detail;
  } catch (const boost::system::system_error& error) {
    if (error.code() == asio::error::operation_aborted) throw;
    failure = error.what();
  } catch (const std::exception& error) {
    failure = error.what();
  }
  spdlog::error("an answer was cut short: {}", failure);
  co_return fail(ErrorCode::internal, failure);
}

}  // namespace

HttpServer::HttpServer(TaskGroup& tasks, Clock& clock, Listener& listener, const RequestGuard& guard,
                       const Router& router, LiveParts& live, TlsGate* tls)
    : tasks_{tasks}, clock_{clock}, listener_{listener}, guard_{guard}, router_{router}, live_{live}, tls_{tls} {}

asio::awaitable<void> HttpServer::run() {
  return listener_.run([this](tcp::socket socket) { on_connection(std::move(socket)); });
}

void HttpServer::on_connection(tcp::socket socket) {
  if (connections_ >= kMaxConnections && !make_room()) {
    if (tls_ != nullptr) return;  // it would not understand
    boost::system::error_code ignored;
    const std::string busy = "HTTP/1.1 503 Service Unavailable\r\nConnection: close\r\nContent-Length: 0\r\n\r\n";
    socket.non_blocking(true, ignored);
    socket.write_some(asio::buffer(busy), ignored);
    return;
  }
  tasks_.spawn("http connection", serve(std::move(socket)));
}

bool HttpServer::make_room() {
  if (strangers_.empty()) return false;
  strangers_.front()->end();  // its connection ends with the next turn of the loop
  strangers_.pop_front();
  return true;
}

asio::awaitable<void> HttpServer::serve(tcp::socket socket) {
  const Counted counted{connections_};
  Connection connection{HttpStream{std::move(socket)}, tls_, clock_, guard_, router_, strangers_};
  co_await (connection.talk() || connection.watch());
  if (!connection.wants_live()) co_return;
  co_await contained("page of " + connection.caller().actor,
                     serve_live(connection.take_stream(), connection.take_upgrade(), connection.caller(), live_));
}

}  // namespace server
