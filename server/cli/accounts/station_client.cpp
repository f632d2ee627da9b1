// HTTP by Beast, without a loop: a tool has nothing else to do while it waits.
#include "server/cli/accounts/station_client.hpp"

#include <fmt/format.h>

#include <boost/asio/connect.hpp>
#include <boost/asio/ssl.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <fstream>
#include <stdexcept>

#include "server/cli/accounts/station_http.hpp"
#include "server/config/endpoint.hpp"
#include "server/storage/database/finished_file.hpp"

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

template <class Stream>
StationAnswer converse(Stream& stream, const HttpRequest& request) {
  http::write(stream, request);
  boost::beast::flat_buffer buffer;
  http::response_parser<http::string_body> parser;
  parser.body_limit(kMaxAnswerBytes);
  http::read(stream, buffer, parser);
  return answer_of(parser.release());
}

// The body goes into the file; that of a refusal is the answer.
template <class Stream>
StationAnswer download(Stream& stream, const HttpRequest& request, const std::filesystem::path& file) {
  http::write(stream, request);
  boost::beast::flat_buffer buffer;
  http::response_parser<http::empty_body> head;
  http::read_header(stream, buffer, head);
  if (head.get().result() != http::status::ok) {
    http::response_parser<http::string_body> refusal{std::move(head)};
    http::read(stream, buffer, refusal);
    return answer_of(refusal.release());
  }
  http::response_parser<http::file_body> parser{std::move(head)};
  parser.body_limit(boost::none);
  boost::beast::error_code failed;
  parser.get().body().open(file.c_str(), boost::beast::file_mode::write, failed);
  if (failed) throw std::runtime_error{fmt::format("cannot write '{}': {}", file.string(), failed.message())};
  http::read(stream, buffer, parser);
  return {200, nullptr, {}};
}

template <class Talk>
StationAnswer talk_in_tls(asio::ip::tcp::socket& socket, const std::filesystem::path& certificate, const Talk& talk) {
  asio::ssl::context context{asio::ssl::context::tls_client};
  asio::ssl::stream<asio::ip::tcp::socket&> stream{socket, context};
  stream.handshake(asio::ssl::stream_base::client);
  check_certificate(stream.native_handle(), certificate);
  return talk(stream);
}

}  // namespace

nlohmann::json asked(StationAnswer answer) {
  constexpr int kFirstSuccess = 200, kFirstRedirection = 300;
  if (answer.status >= kFirstSuccess && answer.status < kFirstRedirection) return std::move(answer.body);
  const bool says_why = answer.body.is_object();
  throw std::runtime_error{
      fmt::format("the station refused: {}", says_why ? answer.body.value("detail", "no reason") : "no reason")};
}

StationClient::StationClient(const std::filesystem::path& data_dir) : token_{token_of(data_dir / "rheonaut.token")} {
  const nlohmann::json announcement = announcement_in(data_dir / "endpoints.json");
  place_.endpoint = endpoint_of(announcement);
  place_.certificate = announcement.value("tls_certificate", "");
}

template <class Talk>
StationAnswer StationClient::with_connection(const Talk& talk) const {
  try {
    asio::io_context loop;
    asio::ip::tcp::socket socket{loop};
    socket.connect(place_.endpoint);
    return place_.certificate.empty() ? talk(socket) : talk_in_tls(socket, place_.certificate, talk);
  } catch (const std::exception& error) {
    throw std::runtime_error{
        fmt::format("the station on {} does not answer: {}", config::text(place_.endpoint), error.what())};
  }
}

StationAnswer StationClient::ask(const std::string& method, const std::string& target,
                                 const nlohmann::json& body) const {
  const HttpRequest request = request_to(method, target, token_, body);
  return with_connection([&](auto& stream) { return converse(stream, request); });
}

void StationClient::save(const std::string& target, const std::filesystem::path& file) const {
  const HttpRequest request = request_to("GET", target, token_, nullptr);
  const storage::Draft part{std::filesystem::path{file}.concat(".part")};
  StationAnswer answer = with_connection([&](auto& stream) { return download(stream, request, part.path()); });
  asked(std::move(answer));
  storage::finish_file(part.path(), file);
}

}  // namespace server::cli
