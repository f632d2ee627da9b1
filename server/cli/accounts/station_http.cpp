// By Beast and OpenSSL.
#include "server/cli/accounts/station_http.hpp"

#include <fmt/format.h>

#include <stdexcept>

#include "server/cli/accounts/station_client.hpp"
#include "server/config/endpoint.hpp"
#include "server/identity/caller.hpp"
#include "server/runtime/secrets.hpp"
#include "server/tls/tls_certificate.hpp"

namespace server::cli {
namespace http = boost::beast::http;

namespace {

std::string& id_of_this_invocation() {
  static std::string id = runtime::random_secret();
  return id;
}

}  // namespace

const std::string& invocation_id() { return id_of_this_invocation(); }

void go_by(std::string id) {
  if (identity::is_client_id(id)) id_of_this_invocation() = std::move(id);
}

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

// SAFETY: another program may have taken the port; it must not get the token.
void check_certificate(const SSL* connection, const std::filesystem::path& certificate) {
  X509* shown = SSL_get0_peer_certificate(connection);
  if (shown == nullptr || tls::describe(*shown).pin != tls::describe(*tls::load_certificate(certificate)).pin) {
    throw std::runtime_error{fmt::format("its key is not that of '{}'", certificate.string())};
  }
}

HttpRequest request_to(const StationPlace& place, const StationRequest& asked, const std::string& token) {
  HttpRequest request{http::string_to_verb(asked.method), asked.target, 11};
  request.set(http::field::host, config::text(place.endpoint));
  request.set(http::field::authorization, "Bearer " + token);
  request.set("Rheonaut-Client", invocation_id());
  request.keep_alive(false);
  if (!asked.body.is_null()) {
    request.set(http::field::content_type, "application/json");
    request.body() = asked.body.dump();
  }
  request.prepare_payload();
  return request;
}

}  // namespace server::cli
