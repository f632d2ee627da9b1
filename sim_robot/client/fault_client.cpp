#include "sim_robot/client/fault_client.hpp"

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http.hpp>
#include <exception>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>

namespace sim_robot {
namespace {

namespace asio = boost::asio;
namespace http = boost::beast::http;

http::request<http::string_body> request_of(const asio::ip::tcp::endpoint& server, const std::string& json) {
  std::ostringstream host;
  host << server;
  http::request<http::string_body> request{http::verb::post, "/faults", 11};
  request.set(http::field::host, host.str());
  request.set(http::field::content_type, "application/json");
  request.body() = json;
  request.prepare_payload();
  return request;
}

asio::awaitable<void> exchange(asio::ip::tcp::endpoint server, http::request<http::string_body> request,
                               http::response<http::string_body>& response, std::chrono::milliseconds time) {
  boost::beast::tcp_stream stream{co_await asio::this_coro::executor};
  stream.expires_after(time);
  co_await stream.async_connect(server, asio::use_awaitable);
  co_await http::async_write(stream, request, asio::use_awaitable);
  boost::beast::flat_buffer buffer;
  co_await http::async_read(stream, buffer, response, asio::use_awaitable);
}

}  // namespace

void post_fault(const asio::ip::tcp::endpoint& server, const std::string& json, std::chrono::milliseconds time) {
  asio::io_context loop{1};
  http::response<http::string_body> response;
  std::exception_ptr failure;
  asio::co_spawn(loop, exchange(server, request_of(server, json), response, time),
                 [&failure](std::exception_ptr error) { failure = std::move(error); });
  loop.run();
  try {
    if (failure) std::rethrow_exception(failure);
  } catch (const boost::system::system_error& error) {
    std::ostringstream text;
    text << "no simulated robot answers at " << server << ": " << error.code().message();
    throw std::runtime_error(text.str());
  }
  if (response.result() == http::status::created) return;
  const auto body = nlohmann::json::parse(response.body(), nullptr, false);
  const bool is_problem = body.is_object() && body.contains("detail") && body["detail"].is_string();
  throw std::runtime_error(is_problem ? body["detail"].get<std::string>()
                                      : "the answer is none of a simulated robot: " + response.body());
}

}  // namespace sim_robot
