// HTTP by Beast, without a loop: a tool has nothing else to do while it waits.
#include "server/cli/accounts/station_client.hpp"

#include <fmt/format.h>

#include <boost/asio/connect.hpp>
#include <boost/asio/ssl.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http.hpp>
#include <fstream>
#include <stdexcept>

#include "server/config/endpoint.hpp"
#include "server/tls/tls_certificate.hpp"

namespace server::cli {
namespace asio = boost::asio;
namespace http = boost::beast::http;

namespace {

nlohmann::json announcement_in(const std::filesystem::path& file) {
  std::ifstream in{file};
  auto content = nlohmann::json::parse(in, nullptr, false);
  if (!content.is_object() || !content.contains("http")) {
    throw std::runtime_error{
        fmt::format("'{}' does not say where the station is: it is starting or stopping; try again", file.string())};
  }
  return content;
}

// A station that listens on every address is asked on loopback.
asio::ip::tcp::endpoint endpoint_of(const nlohmann::json& announcement) {
  auto endpoint = config::parse_endpoint(announcement["http"].get<std::string>());
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

using Request = http::request<http::string_body>;

constexpr std::uint64_t kMaxAnswerBytes = 2'000'000'000;  // of an archive of hours

template <class Stream>
StationAnswer converse(Stream& stream, const Request& request) {
  http::write(stream, request);
  boost::beast::flat_buffer buffer;
  http::response_parser<http::string_body> parser;
  parser.body_limit(kMaxAnswerBytes);
  http::read(stream, buffer, parser);
  http::response<http::string_body> response = parser.release();
  StationAnswer answer;
  answer.status = static_cast<int>(response.result_int());
  const auto type = response[http::field::content_type];
  if (type.starts_with("text/html") || type.starts_with("application/vnd.eln+zip")) {
    answer.text = std::move(response.body());
  } else {
    answer.body = nlohmann::json::parse(response.body());
  }
  return answer;
}

// SAFETY: another program may have taken the port; it must not get the token.
StationAnswer converse_in_tls(asio::ip::tcp::socket& socket, const Request& request,
                              const std::filesystem::path& certificate) {
  asio::ssl::context context{asio::ssl::context::tls_client};
  asio::ssl::stream<asio::ip::tcp::socket&> stream{socket, context};
  stream.handshake(asio::ssl::stream_base::client);
  X509* shown = SSL_get0_peer_certificate(stream.native_handle());
  if (shown == nullptr || tls::describe(*shown).pin != tls::describe(*tls::load_certificate(certificate)).pin) {
    throw std::runtime_error{fmt::format("its key is not that of '{}'", certificate.string())};
  }
  return converse(stream, request);
}

}  // namespace

StationClient::StationClient(const std::filesystem::path& data_dir) : token_{token_of(data_dir / "rheonaut.token")} {
  const nlohmann::json announcement = announcement_in(data_dir / "endpoints.json");
  endpoint_ = endpoint_of(announcement);
  certificate_ = announcement.value("tls_certificate", "");
}

StationAnswer StationClient::ask(const std::string& method, const std::string& target,
                                 const nlohmann::json& body) const {
  Request request{http::string_to_verb(method), target, 11};
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
    return certificate_.empty() ? converse(socket, request) : converse_in_tls(socket, request, certificate_);
  } catch (const std::exception& error) {
    throw std::runtime_error{
        fmt::format("the station on {} does not answer: {}", config::text(endpoint_), error.what())};
  }
}

}  // namespace server::cli
