// Sends the answers of one connection: a whole one with one call, a stream piece by piece as it is made.
//
// 30 s for the client to take a piece. A stream whose client has gone is cancelled; one that fails ends the connection
// without its last chunk. Loop thread. What it is given outlives it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/multiple_exceptions.hpp>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>

#include "server/http/deadline.hpp"
#include "server/http/http_stream.hpp"
#include "server/http/request_reading.hpp"
#include "server/identity/caller.hpp"
#include "server/net/connection_limiter.hpp"
#include "server/runtime/exceptions.hpp"

namespace server::http {

inline constexpr microseconds kWriteTime{std::chrono::seconds{30}};

enum class Next : std::uint8_t { another, end };  // request on this connection

// The name of a request in the log.
std::string route_of(std::string_view method, std::string_view target);

// What the work gives, or nothing when the client goes first: the work is cancelled then, and has ended.
template <class T>
boost::asio::awaitable<std::optional<T>> while_present(HttpStream& stream, boost::asio::awaitable<T> work) {
  using namespace boost::asio::experimental::awaitable_operators;  // NOLINT: operators only
  try {
    std::variant<T, std::monostate> first = co_await (std::move(work) || stream.peer_gone());
    if (first.index() == 0) co_return std::move(std::get<0>(first));
    co_return std::nullopt;
  } catch (const boost::asio::multiple_exceptions&) {  // both were cancelled: the station stops, or the time is over
    throw boost::system::system_error{boost::asio::error::operation_aborted};
  }
}

// The result of the work, or nothing when the credential ends first that asked for it; null: nobody's, never ends.
template <class T>
boost::asio::awaitable<std::optional<T>> while_it_stands(std::shared_ptr<identity::Standing> standing,
                                                         boost::asio::awaitable<T> work) {
  using namespace boost::asio::experimental::awaitable_operators;  // NOLINT: operators only
  if (standing == nullptr) co_return co_await std::move(work);
  try {
    std::variant<T, std::monostate> first = co_await (std::move(work) || standing->wait_for_end());
    if (first.index() == 0) co_return std::move(std::get<0>(first));
    co_return std::nullopt;
  } catch (const boost::asio::multiple_exceptions&) {
    throw boost::system::system_error{boost::asio::error::operation_aborted};
  }
}

class AnswerSender {
 public:
  AnswerSender(HttpStream& stream, net::ConnectionSlot& slot, Deadline& deadline, runtime::Clock& clock,
               runtime::ExceptionLog& exceptions)
      : stream_{stream}, slot_{slot}, deadline_{deadline}, clock_{clock}, exceptions_{exceptions} {}

  boost::asio::awaitable<Next> send(Response response, const RequestMessage& to);

 private:
  boost::asio::awaitable<bool> send_stream(BodyStream& body, bool chunked, std::string route);
  boost::asio::awaitable<Result<std::optional<std::string>>> next_piece(BodyStream& body, const std::string& route);
  template <class Buffers>
  boost::asio::awaitable<bool> write(const Buffers& buffers);

  HttpStream& stream_;
  net::ConnectionSlot& slot_;
  Deadline& deadline_;
  runtime::Clock& clock_;
  runtime::ExceptionLog& exceptions_;
};

}  // namespace server::http
