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
#include "server/storage/database/finished_file.hpp"
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

StationAnswer answer_of(http::response<http::string_body> response) {
  StationAnswer answer;
  answer.status = static_cast<int>(response.result_int());
  if (response[http::field::content_type].contains("json")) {
    answer.body = nlohmann::json::parse(response.body());
  } else {
    answer.text = std::move(response.body());
  }
  return answer;
}

template <class Stream>
StationAnswer converse(Stream& stream, const Request& request) {
  http::write(stream, request);
  boost::beast::flat_buffer buffer;
  http::response_parser<http::string_body> parser;
  parser.body_limit(kMaxAnswerBytes);
  http::read(stream, buffer, parser);
  return answer_of(parser.release());
}

// The body goes into the file; that of a refusal is the answer.
template <class Stream>
StationAnswer download(Stream& stream, const Request& request, const std::filesystem::path& file) {
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

// SAFETY: another program may have taken the port; it must not get the token.
template <class Talk>
StationAnswer talk_in_tls(asio::ip::tcp::socket& socket, const std::filesystem::path& certificate, const Talk& talk) {
  asio::ssl::context context{asio::ssl::context::tls_client};
  asio::ssl::stream<asio::ip::tcp::socket&> stream{socket, context};
  stream.handshake(asio::ssl::stream_base::client);
  X509* shown = SSL_get0_peer_certificate(stream.native_handle());
  if (shown == nullptr || tls::describe(*shown).pin != tls::describe(*tls::load_certificate(certificate)).pin) {
    throw std::runtime_error{fmt::format("its key is not that of '{}'", certificate.string())};
  }
  return talk(stream);
}

Request request_to(const std::string& method, const std::string& target, const std::string& token) {
  Request request{http::string_to_verb(method), target, 11};
  request.set(http::field::host, "localhost");
  request.set(http::field::authorization, "Bearer " + token);
  request.keep_alive(false);
  return request;
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
  endpoint_ = endpoint_of(announcement);
  certificate_ = announcement.value("tls_certificate", "");
}

template <class Talk>
StationAnswer StationClient::with_connection(const Talk& talk) const {
  try {
    asio::io_context loop;
    asio::ip::tcp::socket socket{loop};
    socket.connect(endpoint_);
    return certificate_.empty() ? talk(socket) : talk_in_tls(socket, certificate_, talk);
  } catch (const std::exception& error) {
    throw std::runtime_error{
        fmt::format("the station on {} does not answer: {}", config::text(endpoint_), error.what())};
  }
}

StationAnswer StationClient::ask(const std::string& method, const std::string& target,
                                 const nlohmann::json& body) const {
  Request request = request_to(method, target, token_);
  if (!body.is_null()) {
    request.set(http::field::content_type, "application/json");
    request.body() = body.dump();
  }
  request.prepare_payload();
  return with_connection([&](auto& stream) { return converse(stream, request); });
}

void StationClient::save(const std::string& target, const std::filesystem::path& file) const {
  const Request request = request_to("GET", target, token_);
  const storage::Draft part{std::filesystem::path{file}.concat(".part")};
  StationAnswer answer = with_connection([&](auto& stream) { return download(stream, request, part.path()); });
  asked(std::move(answer));
  storage::finish_file(part.path(), file);
}

}  // namespace server::cli
