// Head and body go in one write; each piece of a stream in another.
#include "server/http/answer_sender.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <array>
#include <boost/asio/as_tuple.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/http/chunk_encode.hpp>

#include "server/http/answer_head.hpp"

namespace server::http {
namespace asio = boost::asio;
namespace http = boost::beast::http;

// SAFETY: without the query, where codes and tickets stand: it is logged.
std::string route_of(std::string_view method, std::string_view target) {
  return fmt::format("{} {}", method, target.substr(0, target.find('?')).substr(0, 200));
}

template <class Buffers>
asio::awaitable<bool> AnswerSender::write(const Buffers& buffers) {
  deadline_.allow(kWriteTime);
  constexpr std::size_t kAtOnce = 65'536;
  auto progress = [&slot = slot_, before = std::size_t{0}](const boost::system::error_code& error,
                                                           std::size_t sent) mutable -> std::size_t {
    slot.moved(sent - std::exchange(before, sent));
    return error ? 0 : kAtOnce;
  };
  const auto [error, size] =
      co_await asio::async_write(stream_, buffers, progress, asio::as_tuple(asio::use_awaitable));
  co_return !error;
}

asio::awaitable<Next> AnswerSender::send(Response response, const RequestMessage& to) {
  const bool has_body = to.method() != http::verb::head && may_have_body(response.status);
  const bool is_framed = response.stream == nullptr || to.version() >= 11;  // else the connection's end is its end
  const Framing framing{to.version(), to.keep_alive() && is_framed, stream_.is_secure(), to[http::field::host]};
  const std::string head = answer_head(response, framing);
  const std::array parts{asio::buffer(head), has_body ? asio::buffer(response.body) : asio::const_buffer{}};
  const bool is_begun = co_await write(parts);
  if (!is_begun) co_return Next::end;
  if (response.stream != nullptr && has_body) {
    const bool is_whole = co_await send_stream(*response.stream, is_framed, route_of(to.method_string(), to.target()));
    if (!is_whole) co_return Next::end;
  }
  co_return framing.keep_alive ? Next::another : Next::end;
}

// False when it was cut short: the missing last chunk shows it to the client (HTTP/1.0 has no way to say so).
asio::awaitable<bool> AnswerSender::send_stream(BodyStream& body, bool chunked, std::string route) {
  for (;;) {
    deadline_.lift();
    const auto made = co_await while_present(stream_, next_piece(body, route));
    if (!made || !*made) co_return false;
    const std::optional<std::string>& piece = **made;
    if (!piece) break;
    if (piece->empty()) continue;
    const auto bytes = asio::buffer(*piece);
    bool is_sent = false;
    if (chunked) {
      is_sent = co_await write(http::make_chunk(bytes));
    } else {
      is_sent = co_await write(bytes);
    }
    if (!is_sent) co_return false;
  }
  if (!chunked) co_return true;
  const bool is_ended = co_await write(http::make_chunk_last());
  co_return is_ended;
}

asio::awaitable<Result<std::optional<std::string>>> AnswerSender::next_piece(BodyStream& body,
                                                                             const std::string& route) {
  std::exception_ptr failure;
  try {
    auto piece = co_await body.next();
    if (!piece) spdlog::error("{}: the answer was cut short: {}", route, piece.error().detail);
    co_return piece;
  } catch (...) {
    failure = runtime::first_of(std::current_exception());
  }
  if (runtime::is_cancellation(failure)) std::rethrow_exception(failure);
  exceptions_.note(runtime::Ended::request, route + ": the answer was cut short", failure, clock_.steady_us());
  co_return fail(ErrorCode::internal, runtime::text_of(failure));
}

}  // namespace server::http
