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

namespace {

// The reason of an error that has none of its own.
const char* reason_of(ErrorCode code) {
  switch (code) {
    case ErrorCode::bad_request: return "bad_request";
    case ErrorCode::unauthorized: return "unauthorized";
    case ErrorCode::forbidden: return "forbidden";
    case ErrorCode::not_found: return "not_found";
    case ErrorCode::conflict: return "conflict";
    case ErrorCode::rejected: return "rejected";
    case ErrorCode::not_connected: return "not_connected";
    case ErrorCode::invalid: return "invalid";
    case ErrorCode::internal: return "internal";
    case ErrorCode::unavailable: return "unavailable";
    case ErrorCode::timed_out: return "timed_out";
  }
  return "internal";
}

std::string reason_of(const Error& error) { return error.reason.empty() ? reason_of(error.code) : error.reason; }

json details(int status, std::string detail, std::string reason) {
  json body{{"type", "about:blank"},
            {"title", reason_phrase(status)},
            {"status", status},
            {"detail", std::move(detail)},
            {"reason", std::move(reason)}};
  if (status == 403) body["needs"] = nullptr;
  return body;
}

json role_for(const Error& error, identity::Role role) {
  return error.code == ErrorCode::forbidden ? json{{"needs", identity::text(role)}} : json::object();
}

}  // namespace

json problem_json(const Error& error, identity::Role needs_if_forbidden) {
  json body = details(http_status(error.code), error.detail, reason_of(error));
  body.update(role_for(error, needs_if_forbidden));
  return body;
}

Response problem(int status, std::string detail, std::string reason, json extra) {
  json body = details(status, std::move(detail), std::move(reason));
  body.update(extra);
  Response response = json_response(status, body);
  response.content_type = "application/problem+json";
  return response;
}

Response problem(const Error& error, json extra) {
  return problem(http_status(error.code), error.detail, reason_of(error), std::move(extra));
}

Response problem(const Error& error, identity::Role needs_if_forbidden) {
  return problem(error, role_for(error, needs_if_forbidden));
}

}  // namespace server::http
