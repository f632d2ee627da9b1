// Requests to the station with an end of each wait: coroutines on a loop of their own.
#include <fmt/format.h>

#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/ssl.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http.hpp>
#include <fstream>
#include <stdexcept>

#include "server/cli/accounts/station_client.hpp"
#include "server/cli/accounts/station_http.hpp"
#include "server/config/endpoint.hpp"
#include "server/runtime/clock.hpp"
#include "server/runtime/exceptions.hpp"
#include "server/runtime/tasks.hpp"
#include "server/storage/database/finished_file.hpp"

namespace server::cli {
namespace asio = boost::asio;
namespace http = boost::beast::http;

namespace {

std::string seconds_text(microseconds time) {
  return fmt::format("{:.3g} s", std::chrono::duration<double>{time}.count());
}

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

// A download: where it goes, and when it got on last.
struct Download {
  std::filesystem::path file;
  runtime::Clock& clock;
  std::int64_t moved_at_us;
};

template <class Stream, class Parser>
asio::awaitable<void> read_body_async(Stream& stream, boost::beast::flat_buffer& buffer, Parser& parser,
                                      Download& download) {
  while (!parser.is_done()) {
    co_await http::async_read_some(stream, buffer, parser, asio::use_awaitable);
    download.moved_at_us = download.clock.steady_us();
  }
}

// The body goes into the file; that of a refusal is the answer.
template <class Stream>
asio::awaitable<StationAnswer> download_async(Stream& stream, const HttpRequest& request, Download& download) {
  co_await http::async_write(stream, request, asio::use_awaitable);
  boost::beast::flat_buffer buffer;
  http::response_parser<http::empty_body> head;
  co_await http::async_read_header(stream, buffer, head, asio::use_awaitable);
  if (head.get().result() != http::status::ok) {
    http::response_parser<http::string_body> refusal{std::move(head)};
    co_await read_body_async(stream, buffer, refusal, download);
    co_return answer_of(refusal.release());
  }
  http::response_parser<http::file_body> parser{std::move(head)};
  parser.body_limit(boost::none);
  boost::beast::error_code failed;
  parser.get().body().open(download.file.c_str(), boost::beast::file_mode::write, failed);
  if (failed) throw std::runtime_error{fmt::format("cannot write '{}': {}", download.file.string(), failed.message())};
  co_await read_body_async(stream, buffer, parser, download);
  co_return StationAnswer{.status = 200, .body = nullptr, .text = {}};
}

// `talk` makes the coroutine of the stream that it is given.
template <class Talk>
asio::awaitable<StationAnswer> connected_async(const StationPlace& place, const Talk& talk) {
  asio::ip::tcp::socket socket{co_await asio::this_coro::executor};
  co_await socket.async_connect(place.endpoint, asio::use_awaitable);
  if (place.certificate.empty()) co_return co_await talk(socket);
  asio::ssl::context context{asio::ssl::context::tls_client};
  asio::ssl::stream<asio::ip::tcp::socket&> stream{socket, context};
  co_await stream.async_handshake(asio::ssl::stream_base::client, asio::use_awaitable);
  check_certificate(stream.native_handle(), place.certificate);
  co_return co_await talk(stream);
}

// Never throws but at its cancellation: what went wrong is the text of the answer.
template <class Talk>
asio::awaitable<void> ask_one(const StationPlace& place, const Talk& talk, StationAnswer& answer) {
  try {
    answer = co_await connected_async(place, talk);
  } catch (...) {
    const std::exception_ptr failure = std::current_exception();
    if (runtime::is_cancellation(failure)) throw;  // its time is up
    answer.is_silent = false;
    answer.text =
        fmt::format("the station on {} does not answer: {}", config::text(place.endpoint), runtime::text_of(failure));
  }
}

// References: to what outlives the loop.
asio::awaitable<void> ask_within(runtime::Clock& clock, microseconds patience, const StationPlace& place,
                                 const HttpRequest& request, StationAnswer& answer) {
  using namespace asio::experimental::awaitable_operators;
  answer.is_silent = true;
  answer.text =
      fmt::format("the station on {} has not answered within {}", config::text(place.endpoint), seconds_text(patience));
  const auto talk = [&](auto& stream) { return exchange_async(stream, request, answer.may_have_arrived); };
  const auto first = co_await (ask_one(place, talk, answer) || clock.sleep_for(patience));
  (void)first;
}

asio::awaitable<void> until_it_stalls(const Download& download, microseconds patience) {
  while (download.clock.steady_us() < download.moved_at_us + patience.count()) {
    co_await download.clock.sleep_until(download.moved_at_us + patience.count());
  }
}

asio::awaitable<void> save_unless_stalled(Download& download, microseconds patience, const StationPlace& place,
                                          const HttpRequest& request, StationAnswer& answer) {
  using namespace asio::experimental::awaitable_operators;
  answer.is_silent = true;
  answer.text =
      fmt::format("the station on {} has sent nothing for {}", config::text(place.endpoint), seconds_text(patience));
  const auto talk = [&](auto& stream) { return download_async(stream, request, download); };
  const auto first = co_await (ask_one(place, talk, answer) || until_it_stalls(download, patience));
  (void)first;
}

}  // namespace

std::vector<StationAnswer> StationClient::ask_at_once(const std::vector<StationRequest>& requests,
                                                      microseconds patience) const {
  std::vector<HttpRequest> prepared;
  for (const StationRequest& one : requests) prepared.push_back(request_to(place_, one, token_));
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

void StationClient::save(const std::string& target, const std::filesystem::path& file, TimeLimit limit) const {
  const HttpRequest request = request_to(place_, {"GET", target}, token_);
  const storage::Draft part{std::filesystem::path{file}.concat(".part")};
  if (!std::ofstream{part.path()}) throw std::runtime_error{fmt::format("cannot write '{}'", part.path().string())};
  asio::io_context loop{1};
  runtime::SystemClock clock{loop};
  Download download{part.path(), clock, clock.steady_us()};
  StationAnswer answer;
  runtime::run_first(loop, save_unless_stalled(download, limit.time, place_, request, answer));
  if (answer.status == 0) throw std::runtime_error{answer.text + (answer.is_silent ? advice(limit) : "")};
  asked(std::move(answer));
  storage::finish_file(part.path(), file);
}

}  // namespace server::cli
