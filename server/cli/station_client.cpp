// HTTP by Beast, without a loop: a tool has nothing else to do while it waits.
#include "server/cli/station_client.hpp"

#include <fmt/format.h>

#include <boost/asio/connect.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http.hpp>
#include <fstream>
#include <stdexcept>

#include "server/endpoint.hpp"

namespace server::cli {
namespace asio = boost::asio;
namespace http = boost::beast::http;

namespace {

// A station that listens on every address is asked on loopback.
asio::ip::tcp::endpoint endpoint_of(const std::filesystem::path& file) {
  std::ifstream in{file};
  const auto content = nlohmann::json::parse(in, nullptr, false);
  if (!content.is_object() || !content.contains("http")) {
    throw std::runtime_error{
        fmt::format("'{}' does not say where the station is: it is starting or stopping; try again", file.string())};
  }
  auto endpoint = parse_endpoint(content["http"].get<std::string>());
  if (endpoint.address().is_unspecified()) endpoint.address(asio::ip::address_v4::loopback());
  return endpoint;
}

std::string token_of(const std::filesystem::path& file) {
  std::ifstream in{file};
  std::string token;
  if (!std::getline(in, token) || token.empty()) {
    throw std::runtime_error{fmt::format("cannot read the station's token in '{}'", file.string())};
  }
  return token;
}

}  // namespace

StationClient::StationClient(const std::filesystem::path& data_dir)
    : endpoint_{endpoint_of(data_dir / "endpoints.json")}, token_{token_of(data_dir / "rheonaut.token")} {}

StationAnswer StationClient::ask(const std::string& method, const std::string& target,
                                 const nlohmann::json& body) const {
  http::request<http::string_body> request{http::string_to_verb(method), target, 11};
  request.set(http::field::host, "localhost");
  request.set(http::field::authorization, "Bearer " + token_);
  request.keep_alive(false);
  if (!body.is_null()) {
    request.set(http::field::content_type, "application/json");
    request.body() = body.dump();
  }
  request.prepare_payload();
  try {
    asio::io_context loop;
    asio::ip::tcp::socket socket{loop};
    socket.connect(endpoint_);
    http::write(socket, request);
    boost::beast::flat_buffer buffer;
    http::response<http::string_body> response;
    http::read(socket, buffer, response);
    return {static_cast<int>(response.result_int()), nlohmann::json::parse(response.body())};
  } catch (const std::exception& error) {
    throw std::runtime_error{fmt::format("the station on {} does not answer: {}", text(endpoint_), error.what())};
  }
}

}  // namespace server::cli
