// StationClient::ask_at_once: one coroutine for each request, on a loop of its own.
#include <fmt/format.h>

#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/ssl.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http.hpp>

#include "server/cli/accounts/station_client.hpp"
#include "server/cli/accounts/station_http.hpp"
#include "server/config/endpoint.hpp"
#include "server/runtime/clock.hpp"
#include "server/runtime/exceptions.hpp"
#include "server/runtime/tasks.hpp"

namespace server::cli {
namespace asio = boost::asio;
namespace http = boost::beast::http;

namespace {

template <class Stream>
asio::awaitable<StationAnswer> exchange_async(Stream& stream, const HttpRequest& request, bool& may_have_arrived) {
  may_have_arrived = true;
  co_await http::async_write(stream, request, asio::use_awaitable);
  boost::beast::flat_buffer buffer;
  http::response_parser<http::string_body> parser;
  parser.body_limit(kMaxAnswerBytes);
  co_await http::async_read(stream, buffer, parser, asio::use_awaitable);
  co_return answer_of(parser.release());
}

asio::awaitable<StationAnswer> connect_and_exchange_async(const StationPlace& place, const HttpRequest& request,
                                                          bool& may_have_arrived) {
  asio::ip::tcp::socket socket{co_await asio::this_coro::executor};
  co_await socket.async_connect(place.endpoint, asio::use_awaitable);
  if (place.certificate.empty()) co_return co_await exchange_async(socket, request, may_have_arrived);
  asio::ssl::context context{asio::ssl::context::tls_client};
  asio::ssl::stream<asio::ip::tcp::socket&> stream{socket, context};
  co_await stream.async_handshake(asio::ssl::stream_base::client, asio::use_awaitable);
  check_certificate(stream.native_handle(), place.certificate);
  co_return co_await exchange_async(stream, request, may_have_arrived);
}

// Never throws but at its cancellation: what went wrong is the text of the answer.
asio::awaitable<void> ask_one(const StationPlace& place, const HttpRequest& request, StationAnswer& answer) {
  try {
    answer = co_await connect_and_exchange_async(place, request, answer.may_have_arrived);
  } catch (...) {
    const std::exception_ptr failure = std::current_exception();
    if (runtime::is_cancellation(failure)) throw;  // its time is up
    answer.text =
        fmt::format("the station on {} does not answer: {}", config::text(place.endpoint), runtime::text_of(failure));
  }
}

// References: to what outlives the loop.
asio::awaitable<void> ask_within(runtime::Clock& clock, microseconds patience, const StationPlace& place,
                                 const HttpRequest& request, StationAnswer& answer) {
  using namespace asio::experimental::awaitable_operators;
  answer.text = fmt::format("the station on {} has not answered within {} ms", config::text(place.endpoint),
                            patience.count() / 1000);
  const auto first = co_await (ask_one(place, request, answer) || clock.sleep_for(patience));
  (void)first;
}

}  // namespace

std::vector<StationAnswer> StationClient::ask_at_once(const std::vector<StationRequest>& requests,
                                                      microseconds patience) const {
  std::vector<HttpRequest> prepared;
  for (const StationRequest& one : requests) prepared.push_back(request_to(one.method, one.target, token_, one.body));
  std::vector<StationAnswer> answers(requests.size());
  asio::io_context loop{1};
  runtime::SystemClock clock{loop};
  runtime::TaskGroup tasks{loop};
  for (std::size_t i = 0; i < requests.size(); ++i) {
    tasks.spawn("request", ask_within(clock, patience, place_, prepared[i], answers[i]));
  }
  loop.run();
  return answers;
}

}  // namespace server::cli
