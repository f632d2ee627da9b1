// What a request to the station and its answer are in HTTP, for StationClient alone.
#pragma once

#include <openssl/ssl.h>

#include <boost/beast/http.hpp>

#include "server/cli/accounts/station_answer.hpp"

namespace server::cli {

using HttpRequest = boost::beast::http::request<boost::beast::http::string_body>;

inline constexpr std::uint64_t kMaxAnswerBytes = 2'000'000'000;  // of an archive of hours

// With the station's token, and the id of this invocation (station_client.hpp); null: without a body. The Host is the
// address that is asked, with its port: the station makes links of it.
HttpRequest request_to(const StationPlace& place, const StationRequest& request, const std::string& token);

// Throws nlohmann::json::exception for a body that is not what its header says.
StationAnswer answer_of(boost::beast::http::response<boost::beast::http::string_body> response);

// Throws std::runtime_error unless the other end of the connection has the key of this certificate.
void check_certificate(const SSL* connection, const std::filesystem::path& certificate);

}  // namespace server::cli
