// Answers with embedded files.
#include "server/api/routes/assets.hpp"

#include <algorithm>
#include <array>
#include <string>
#include <utility>

namespace server::api {
namespace {

constexpr std::array<std::pair<std::string_view, const char*>, 13> kContentTypes{{
    {".html", "text/html; charset=utf-8"},
    {".js", "text/javascript; charset=utf-8"},
    {".css", "text/css; charset=utf-8"},
    {".json", "application/json"},
    {".map", "application/json"},
    {".webmanifest", "application/manifest+json"},
    {".svg", "image/svg+xml"},
    {".png", "image/png"},
    {".ico", "image/x-icon"},
    {".woff", "font/woff"},
    {".woff2", "font/woff2"},
    {".txt", "text/plain; charset=utf-8"},
    {".yaml", "application/yaml; charset=utf-8"},
}};

const char* content_type_of(std::string_view name) {
  const std::string_view ending = name.substr(std::min(name.rfind('.'), name.size()));
  const auto found = std::ranges::find(kContentTypes, ending, [](const auto& known) { return known.first; });
  return found == kContentTypes.end() ? "application/octet-stream" : found->second;
}

}  // namespace

http::Response asset_response(const http::Request& request, const base::EmbeddedFile& file) {
  const std::string etag = '"' + std::string{file.digest} + '"';
  http::Response response;
  response.content_type = content_type_of(file.name);
  response.headers.emplace_back("ETag", etag);
  const bool hashed = file.name.starts_with("/assets/");
  response.headers.emplace_back("Cache-Control", hashed ? "public, max-age=31536000, immutable" : "no-cache");
  if (request.header("if-none-match").find(etag) != std::string::npos) {
    response.status = 304;
    return response;
  }
  response.body = file.content;
  return response;
}

http::Response page_response(const http::Request& request) {
  if (request.method != "GET" && request.method != "HEAD") {
    http::Response response = http::problem(405, request.method + " is not possible here", "method_not_allowed");
    response.headers.emplace_back("Allow", "GET, HEAD");
    return response;
  }
  const std::string path = request.path == "/" ? "/index.html" : request.path;
  const auto files = cockpit_files();
  const auto found = std::ranges::find(files, path, &base::EmbeddedFile::name);
  if (found != files.end()) return asset_response(request, *found);
  if (path == "/index.html") {
    return http::html_response(
        200,
        "<!doctype html><title>Rheonaut</title><p>This station was built without the cockpit. Its API "
        "answers under /api/v1; build the target web_dist and then the station to have the page.");
  }
  return http::problem(404, "there is nothing at this path", "unknown_path");
}

std::string_view page_of_an_old_link() {
  const auto files = cockpit_files();
  const auto cockpit = std::ranges::find(files, "/index.html", &base::EmbeddedFile::name);
  if (cockpit != files.end()) return cockpit->content;
  return "<!doctype html><title>Rheonaut</title><p>This link was used already, or is older than 10 minutes. On the "
         "station's machine, `rheonaut login-link --data FOLDER` makes a new one.";
}

}  // namespace server::api
