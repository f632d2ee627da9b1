// Builds responses and problem details.
#include "server/http/http.hpp"

#include "base/json_text.hpp"

namespace server::http {

using nlohmann::json;

const char* reason_phrase(int status) {
  switch (status) {
    case 200: return "OK";
    case 201: return "Created";
    case 202: return "Accepted";
    case 303: return "See Other";
    case 304: return "Not Modified";
    case 400: return "Bad Request";
    case 401: return "Unauthorized";
    case 403: return "Forbidden";
    case 404: return "Not Found";
    case 405: return "Method Not Allowed";
    case 408: return "Request Timeout";
    case 409: return "Conflict";
    case 413: return "Content Too Large";
    case 414: return "URI Too Long";
    case 415: return "Unsupported Media Type";
    case 421: return "Misdirected Request";
    case 422: return "Unprocessable Content";
    case 426: return "Upgrade Required";
    case 429: return "Too Many Requests";
    case 431: return "Request Header Fields Too Large";
    case 500: return "Internal Server Error";
    case 503: return "Service Unavailable";
    case 504: return "Gateway Timeout";
    default: return "Unknown";
  }
}

int http_status(ErrorCode code) {
  switch (code) {
    case ErrorCode::bad_request: return 400;
    case ErrorCode::unauthorized: return 401;
    case ErrorCode::forbidden: return 403;
    case ErrorCode::not_found: return 404;
    case ErrorCode::conflict:
    case ErrorCode::rejected:
    case ErrorCode::not_connected: return 409;
    case ErrorCode::invalid: return 422;
    case ErrorCode::internal: return 500;
    case ErrorCode::unavailable: return 503;
    case ErrorCode::timed_out: return 504;
  }
  return 500;
}

Response json_response(int status, const json& body) { return json_text_response(status, base::dump(body)); }

Response json_text_response(int status, std::string text) {
  Response response;
  response.status = status;
  response.content_type = "application/json";
  response.body = std::move(text);
  response.headers.emplace_back("Cache-Control", "no-store");
  return response;
}

Response html_response(int status, std::string body) {
  Response response;
  response.status = status;
  response.content_type = "text/html; charset=utf-8";
  response.body = std::move(body);
  response.headers.emplace_back("Cache-Control", "no-store");
  return response;
}

json problem_json(int status, std::string detail, std::string reason) {
  return {{"type", "about:blank"},
          {"title", reason_phrase(status)},
          {"status", status},
          {"detail", std::move(detail)},
          {"reason", std::move(reason)}};
}

Response problem(int status, std::string detail, std::string reason, json extra) {
  json body = problem_json(status, std::move(detail), std::move(reason));
  body.update(extra);
  Response response = json_response(status, body);
  response.content_type = "application/problem+json";
  return response;
}

Response problem(const Error& error, json extra) {
  return problem(http_status(error.code), error.detail, error.reason, std::move(extra));
}

}  // namespace server::http
